//! How a list goes on a device: which rows of level 0 it holds, and the steps of each run.

use super::{Gpu, Step};
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

    /// The steps of `run`, recorded on first use.
    pub(super) fn steps_of(&mut self, run: &Run) -> Result<Arc<[Step]>> {
        let mut state = self.state.take().expect("prepare comes before every stage");
        let steps = match state.steps.get(run) {
            Some(steps) => Ok(Arc::clone(steps)),
            None => self.recorded(run, &state.plan, &state.buffers, None),
        };
        if let Ok(steps) = &steps {
            state.steps.entry(run.clone()).or_insert_with(|| Arc::clone(steps));
        }
        self.state = Some(state);
        steps
    }
}
