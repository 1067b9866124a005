//! The change of the label map.

use crate::common::twin;
use crate::common::twin::belief::belief_most;
use crate::on_all;
use mrfgs::low_level::backend::Volume;

#[test]
fn change() {
    on_all(|case, backend, random| {
        let labels = case.plan.levels[0].labels;
        let mut map = vec![0; case.plan.levels[0].pixels()];
        for _ in 0..4 {
            let most = random.pick(&[0, 2, belief_most(&case.plan)]);
            let belief = case.beliefs(random, most);
            backend.probe().write(Volume::Belief(0), &belief).unwrap();
            let (actual, expected) =
                (backend.change().unwrap(), twin::change::change(&belief, labels, &mut map));
            if actual != expected {
                return Err(format!("a change of {actual} but the twin says {expected}"));
            }
        }
        Ok(())
    });
}
