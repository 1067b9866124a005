//! The evidence.

use crate::common::twin;
use crate::{on_all, random_cost, same};
use mrfgs::low_level::backend::{Stage, Volume};

#[test]
fn evidence() {
    on_all(|case, backend, random| {
        for z in 0..case.plan.levels.len() {
            let cost = random_cost(random, &case.plan, z);
            let has = twin::label_window::ranges(&case.plan, z, &case.windows[z]);
            let poison = vec![231; cost.len()];
            backend.probe().write(Volume::Cost(z), &cost).unwrap();
            backend.probe().write(Volume::Evidence(z), &poison).unwrap();
            backend.probe().write(Volume::Belief(z), &poison).unwrap();
            backend.run(Stage::Evidence(z)).unwrap();
            let expected = twin::evidence::evidence(&case.plan, z, &has, &cost);
            same(&case.plan, backend, Volume::Evidence(z), &expected)?;
            same(&case.plan, backend, Volume::Belief(z), &twin::evidence::beliefs(&case.plan, &expected))?;
        }
        Ok(())
    });
}
