//! The matching cost.

use crate::common::devices::backends;
use crate::common::random::{self, Random};
use crate::common::twin;
use crate::{cells, on_all, same};
use mrfgs::low_level::backend::{Stage, Volume};
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::graph;
use mrfgs::options::MatchingCost;

#[test]
fn cost() {
    on_all(|case, backend, random| {
        for cost in [MatchingCost::Sad, MatchingCost::Census, MatchingCost::AdCensus] {
            let mut plan = case.plan.clone();
            plan.method.cost.matching = cost;
            backend.prepare(&plan, Prepared::new(&case.pair, case.graphs.clone())).unwrap();
            let poison: Vec<u32> = (0..cells(&plan, 0)).map(|_| random.within(0, 255)).collect();
            backend.probe().write(Volume::Cost(0), &poison).unwrap();
            backend.run(Stage::Cost).unwrap();
            same(&plan, backend, Volume::Cost(0), &twin::cost::cost(&plan, &case.pair))?;
        }
        Ok(())
    });
}

#[test]
fn cost_with_the_largest_window() {
    let mut random = Random::new(31);
    let mut method = random::method(&mut random, 0);
    (method.cost.matching, method.cost.sad_window, method.cost.outside_cost) = (MatchingCost::Sad, 31, 20.0);
    let plan = random::plan((37, 33), -3, 9, &method);
    let pair = random::pair(&mut random, 37, 33);
    for (name, mut backend) in backends() {
        backend.prepare(&plan, Prepared::new(&pair, graph::build(pair.left(), &plan))).unwrap();
        backend.run(Stage::Cost).unwrap();
        if let Err(e) = same(&plan, backend.as_mut(), Volume::Cost(0), &twin::cost::cost(&plan, &pair)) {
            panic!("{name}: {e}");
        }
    }
}
