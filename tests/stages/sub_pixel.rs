//! The sub-pixel disparity.

use crate::common::compare::compare_finest;
use crate::common::twin::belief::belief_most;
use crate::common::{random, twin};
use crate::{cells, on_all, random_cost};
use mrfgs::low_level::backend::{Stage, Volume};

#[test]
fn sub_pixel() {
    on_all(|case, backend, random| {
        for most in [0, 2, belief_most(&case.plan)] {
            let belief: Vec<u32> = (0..cells(&case.plan, 0)).map(|_| random.within(0, most)).collect();
            let cost = random_cost(random, &case.plan, 0);
            let mut maps = random::finest(random, &case.plan, false);
            // Labels that a match may leave.
            twin::winner_takes_all::winner_takes_all(&case.plan, &belief, &mut maps);
            backend.probe().write(Volume::Cost(0), &cost).unwrap();
            maps.write(backend);
            backend.run(Stage::SubPixel).unwrap();
            twin::sub_pixel::sub_pixel(&case.plan, &cost, &mut maps);
            compare_finest(backend, &maps)?;
        }
        Ok(())
    });
}
