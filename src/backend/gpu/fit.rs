//! Fits programs to a device: the rows of level 0 that it holds, and the commands of each run.

use super::buffers::Exchanged;
use super::commands::Pipeline;
use super::{Command, Gpu, MAX_LOOP_ITERATIONS, State, kernels, other_kernels};
use crate::error::{Purpose, Result};
use crate::memory;
use crate::plan::Plan;
use crate::program::schedule::split;
use crate::program::{Program, Run, Sent, Step, together};
use crate::stage::Stage;
use crate::threads::prelude::*;
use std::collections::HashMap;
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

    /// Compiles the kernels of `program` in parallel, unless the device holds a match of its plans already. A kernel that is missing is
    /// compiled on first use, and failures are reported there.
    pub(super) fn compile(&mut self, program: &Program) {
        let held: Vec<_> =
            [&self.state, &self.other].into_iter().flatten().map(|state| &state.plan).collect();
        if program.frames.iter().all(|frame| held.iter().any(|plan| frame.plan.fits(plan))) {
            return;
        }
        let runs = program.with_plans().filter_map(|(step, plan)| match step {
            Step::Run(run) => Some((run, plan)),
            _ => None,
        });
        let of_stages = runs.flat_map(|(run, plan)| {
            let parts = split(run.clone()).into_iter();
            parts.flat_map(|part| part.stages().collect::<Vec<_>>()).flat_map(|stage| kernels(stage, plan))
        });
        let of_transfers = program.frames.iter().flat_map(|frame| other_kernels(&frame.plan));
        let mut missing = HashMap::new();
        for kernel in of_stages.chain(of_transfers) {
            if kernel.loops <= MAX_LOOP_ITERATIONS && !self.pipelines.contains_key(&kernel.shader) {
                missing.insert(kernel.shader.clone(), kernel);
            }
        }
        let Ok(device) = self.device.inner() else { return };
        let missing: Vec<_> = missing.into_iter().collect();
        let compiled =
            missing.par_iter().map(|(shader, kernel)| (shader.clone(), Pipeline::compiled(device, kernel)));
        let compiled: Vec<_> = compiled.collect();
        self.pipelines.extend(compiled);
    }

    /// The commands of `run`, recorded on first use. Their messages count as sent from now on.
    pub(super) fn commands_of(&mut self, run: &Run) -> Result<Arc<[Command]>> {
        let mut state = self.state.take().expect("prepare comes before every stage");
        let exchanged =
            if run.stage.passes_messages() { Exchanged::default() } else { state.buffers.exchanged };
        let of_run = (run.clone(), sent(&state, run), exchanged);
        let commands = if let Some(commands) = state.commands.get(&of_run) {
            Ok(Arc::clone(commands))
        } else {
            let recorded = |gpu: &mut Self| gpu.recorded(run, &of_run.1, &state.plan, &state.buffers, None);
            self.device.look().and_then(|()| recorded(self))
        };
        if let Ok(commands) = &commands {
            run.stages().for_each(|stage| state.messages.send(stage));
            state.commands.entry(of_run).or_insert_with(|| Arc::clone(commands));
        }
        self.state = Some(state);
        commands
    }
}

/// The messages that exist at each level of `run`; none listed if all do, or if it reads none.
fn sent(state: &State, run: &Run) -> Vec<Sent> {
    if !run.stage.passes_messages() {
        return Vec::new();
    }
    let at = |stage| run.band.as_ref().map_or_else(|| state.messages.at(stage), |band| band.sent);
    let all = |stage: Stage| Sent::all(stage.level().unwrap_or(0), state.plan.levels.len());
    let sent: Vec<_> = run.stages().map(at).collect();
    if run.stages().map(all).eq(sent.iter().copied()) { Vec::new() } else { sent }
}
