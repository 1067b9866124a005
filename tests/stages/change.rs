//! The change of the label map.

use crate::common::devices::backends;
use crate::common::random::{self, Random};
use crate::common::twin;
use crate::common::twin::belief::belief_most;
use crate::on_all;
use mrfgs::low_level::backend::{Stage, Volume};
use mrfgs::low_level::front::Prepared;
use pollster::block_on;

#[test]
fn change() {
    on_all(|case, backend, random| {
        let labels = case.plan.levels[0].labels;
        let mut map = vec![0; case.plan.levels[0].pixels()];
        for _ in 0..4 {
            let most = random.pick(&[0, 2, belief_most(&case.plan)]);
            let belief = case.beliefs(random, most);
            backend.probe().write(Volume::Belief(0), &belief).unwrap();
            backend.run(Stage::Change).unwrap();
            let (actual, expected) =
                (backend.probe().change().unwrap(), twin::change::change(&belief, labels, &mut map));
            if actual != expected {
                return Err(format!("a change of {actual} but the twin says {expected}"));
            }
        }
        Ok(())
    });
}

/// A map settles if it changes by at most the tolerance, but not the first time.
#[test]
fn a_map_settles() {
    let mut random = Random::new(3);
    let mut method = random::method(&mut random, 2);
    (method.graph.levels, method.schedule.tolerance) = (1, 0.5);
    let plan = random::plan((12, 9), 0, 7, &method);
    let pair = random::pair(&mut random, 12, 9);
    // Beliefs with the label `few` at the first `moved` pixels, and `most` at the others.
    let belief = |(most, few): (usize, usize), moved: usize| {
        let best = |pixel: usize| if pixel < moved { few } else { most };
        (0..12 * 9 * 7).map(|i| u32::from(i % 7 != best(i / 7))).collect::<Vec<_>>()
    };
    for (name, mut backend) in backends() {
        for _ in 0..2 {
            backend.prepare(&plan, Prepared::new(&pair)).unwrap();
            // 27 pixels that change by one are a mean square of a quarter.
            let steps = [((0, 0), 0, false), ((0, 1), 28, false), ((0, 1), 1, true)];
            for (i, (labels, moved, settled)) in steps.into_iter().enumerate() {
                backend.probe().write(Volume::Belief(0), &belief(labels, moved)).unwrap();
                backend.run(Stage::Change).unwrap();
                assert_eq!(block_on(backend.settled(true)).unwrap(), settled, "{name}, {i}");
            }
        }
    }
}
