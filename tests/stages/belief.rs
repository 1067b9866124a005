//! The beliefs.

use crate::common::twin;
use crate::{cells, on_all, same};
use mrfgs::low_level::backend::{Stage, Volume};

#[test]
fn belief() {
    on_all(|case, backend, random| {
        let state = case.state(random, false);
        state.write(backend);
        for z in 0..case.plan.levels.len() {
            let poison = vec![twin::most(&case.plan); cells(&case.plan, z)];
            backend.probe().write(Volume::Belief(z), &poison).unwrap();
            backend.run(Stage::Belief(z)).unwrap();
            same(&case.plan, backend, Volume::Belief(z), &state.belief[z])?;
        }
        Ok(())
    });
}
