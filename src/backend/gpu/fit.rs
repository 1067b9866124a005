//! Fits programs to a device: the rows of level 0 that it holds, and the commands of each run.

use super::{Command, Gpu};
use crate::error::{Purpose, Result};
use crate::memory;
use crate::plan::Plan;
use crate::program::{Run, together};
use std::sync::Arc;

impl Gpu {
    /// Whether to hold all rows of level 0: if the method's memory limit and the device's memory allow it.
    pub(super) fn holds_all_rows(&self, plan: &Plan) -> bool {
        let streamed = together::streamed(plan);
        // Keep the decision for the last pair.
        let known = self.state.as_ref().map(|state| &state.plan);
        if let Some(known) = known.filter(|known| plan.fits(known) || streamed.fits(known)) {
            return known.holds_all_rows();
        }
        let bytes = plan.bytes();
        streamed.holds_all_rows()
            || bytes <= u64::from(plan.memory) << 20
                && self.device.memory.is_none_or(|memory| bytes <= memory)
                && (!self.device.software || memory::check(bytes, Purpose::Match).is_ok())
    }

    /// The commands of `run`, recorded on first use.
    pub(super) fn commands_of(&mut self, run: &Run) -> Result<Arc<[Command]>> {
        let mut state = self.state.take().expect("prepare comes before every stage");
        let commands = match state.commands.get(run) {
            Some(commands) => Ok(Arc::clone(commands)),
            None => self.recorded(run, &state.plan, &state.buffers, None),
        };
        if let Ok(commands) = &commands {
            state.commands.entry(run.clone()).or_insert_with(|| Arc::clone(commands));
        }
        self.state = Some(state);
        commands
    }
}
