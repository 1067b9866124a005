//! The messages of the dependency factors.

use crate::common::twin;
use crate::{on_all, same};
use mrfgs::low_level::backend::{Stage, Volume};

#[test]
fn dependency() {
    on_all(|case, backend, random| {
        for loose in [false, true] {
            let state = case.state(random, loose);
            state.write(backend);
            for (z, graph) in case.graphs.iter().enumerate() {
                backend.run(Stage::Dependency(z)).unwrap();
                let expected = twin::dependency::dependency(
                    &case.plan,
                    z,
                    graph,
                    &state.has[z],
                    &state.belief[z],
                    &state.dependency[z],
                );
                same(&case.plan, backend, Volume::Dependency(z), &expected)?;
                same(&case.plan, backend, Volume::Belief(z), &state.belief[z])?;
            }
        }
        Ok(())
    });
}
