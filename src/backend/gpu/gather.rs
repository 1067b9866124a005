//! Gathers the same stage at one level after the other, to run it in one dispatch where the levels share buffers.

use super::levels::{can_share, next_level};
use super::{Gpu, State, flood};
use crate::backend::Stage;
use crate::error::Result;
use std::mem;
use std::sync::Arc;

impl State {
    /// Whether `stage` may wait for others that run together with it.
    pub(super) fn may_wait(&self, stage: Stage) -> bool {
        next_level(stage).is_some() && self.buffers.shared.as_ref().is_some_and(|s| can_share(stage, s))
    }
}

impl Gpu {
    /// Records the stages that wait.
    pub(super) fn gather(&mut self) -> Result<()> {
        let waiting = mem::take(&mut self.waiting);
        let Some(&first) = waiting.first() else { return Ok(()) };
        let parts = if matches!(first, Stage::Flood(_)) { 0..2 } else { 0..1 };
        for part in parts {
            let stages = waiting.iter().map(|&stage| match stage {
                Stage::Flood(z) => flood::parts(z)[part],
                stage => stage,
            });
            let stages: Vec<Stage> = stages.collect();
            let state = self.state();
            let steps = match state.steps.get(&(stages[0], stages.len())) {
                Some(steps) => vec![Arc::clone(steps)],
                None => stages.iter().map(|stage| Arc::clone(&state.steps[&(*stage, 1)])).collect(),
            };
            for steps in steps {
                self.record(&steps)?;
            }
        }
        Ok(())
    }
}
