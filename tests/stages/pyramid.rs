//! The costs of the coarser levels.

use crate::common::twin;
use crate::{on_all, random_cost, same};
use mrfgs::low_level::backend::{Stage, Volume};

#[test]
fn pyramid() {
    on_all(|case, backend, random| {
        for z in 1..case.plan.levels.len() {
            let fine = random_cost(random, &case.plan, z - 1);
            let poison = random_cost(random, &case.plan, z);
            backend.probe().write(Volume::Cost(z - 1), &fine).unwrap();
            backend.probe().write(Volume::Cost(z), &poison).unwrap();
            backend.run(Stage::Pyramid(z)).unwrap();
            same(&case.plan, backend, Volume::Cost(z), &twin::pyramid::pyramid(&case.plan, z, &fine))?;
            same(&case.plan, backend, Volume::Cost(z - 1), &fine)?;
        }
        Ok(())
    });
}
