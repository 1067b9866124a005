//! The evidence.

use crate::common::twin;
use crate::{on_all, random_cost, same};
use mrfgs::backend::Stage;
use mrfgs::backend::probe::Volume;

#[test]
fn evidence() {
    on_all(|case, backend, random| {
        for z in 0..case.plan.levels.len() {
            let cost = random_cost(random, &case.plan, z);
            let poison = vec![231; cost.len()];
            backend.write(Volume::Cost(z), &cost).unwrap();
            backend.write(Volume::Evidence(z), &poison).unwrap();
            backend.write(Volume::Belief(z), &poison).unwrap();
            backend.run(Stage::Evidence(z)).unwrap();
            let expected = twin::evidence::evidence(&case.plan, z, &cost);
            same(&case.plan, backend, Volume::Evidence(z), &expected)?;
            same(&case.plan, backend, Volume::Belief(z), &expected)?;
        }
        Ok(())
    });
}
