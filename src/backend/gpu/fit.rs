//! How a list goes on a device: which rows of level 0 it holds, and the commands of each run.

use super::{Command, Gpu};
use crate::error::{Purpose, Result};
use crate::memory;
use crate::plan::Plan;
use crate::program::{Run, together};
use std::sync::Arc;

impl Gpu {
    /// Whether this device matches by `plan` with all rows of level 0 held: where the method's memory and its own are enough.
    pub(super) fn holds_all_rows(&self, plan: &Plan) -> bool {
        let streamed = together::streamed(plan);
        // What was settled for the last pair stays.
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
