//! Messages between levels.

use crate::{on_all, resolve, same};
use mrfgs::low_level::backend::{Stage, Volume};

#[test]
fn resolution() {
    on_all(|case, backend, random| {
        for loose in [false, true] {
            let mut state = case.state(random, loose);
            state.write(backend);
            for z in 1..case.plan.levels.len() {
                backend.run(Stage::Resolution(z)).unwrap();
                resolve(&case.plan, &mut state, z);
                same(&case.plan, backend, Volume::Down(z - 1), &state.down[z - 1])?;
                same(&case.plan, backend, Volume::Up(z), &state.up[z])?;
            }
        }
        Ok(())
    });
}
