//! Winner takes all: the optimum of the beliefs.

use crate::common::compare::compare_finest;
use crate::common::twin::belief::belief_most;
use crate::common::{random, twin};
use crate::on_all;
use mrfgs::low_level::backend::{Stage, Volume};

#[test]
fn winner_takes_all() {
    on_all(|case, backend, random| {
        for most in [0, 2, belief_most(&case.plan)] {
            let belief = case.beliefs(random, most);
            backend.probe().write(Volume::Belief(0), &belief).unwrap();
            let mut maps = random::finest(random, &case.plan, false);
            maps.write(backend);
            backend.run(Stage::WinnerTakesAll).unwrap();
            twin::winner_takes_all::winner_takes_all(&case.plan, &belief, &mut maps);
            compare_finest(backend, &maps)?;
        }
        Ok(())
    });
}
