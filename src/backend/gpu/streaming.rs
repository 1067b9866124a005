//! Level 0 where it is not held whole: the stages that need it run on some of its rows at a time, in a
//! [wavefront](crate::backend::wavefront), and its volumes are rings of parts.

use super::{Gpu, Step, record};
use crate::backend::wavefront::Wavefront;
use crate::backend::{Backend, Stage};
use crate::error::{Purpose, Result};
use crate::memory;
use crate::plan::Plan;
use std::ops::Range;
use std::sync::Arc;

impl Gpu {
    /// The plan by which this device matches: [`Plan::on_device`] where its own memory is enough.
    pub(super) fn held(&self, plan: &Plan) -> Plan {
        let known = self.state.as_ref().map(|state| &state.plan);
        let most = plan.on_device();
        // What was settled for the last pair stays.
        if let Some(known) = known.filter(|known| most.fits(known) || plan.fits(known)) {
            return Plan { core: plan.core.clone(), ..known.clone() };
        }
        let bytes = most.bytes();
        let fits = self.device.memory.is_none_or(|memory| bytes <= memory)
            && (!self.device.software || memory::check(bytes, Purpose::Match).is_ok());
        if fits { most } else { plan.clone() }
    }

    /// Runs the stages of `wavefront` on the rows of its parts.
    pub(super) async fn run_parts(
        &mut self,
        wavefront: &Wavefront,
        before: &mut dyn FnMut(Stage, f64) -> Result<()>,
    ) -> Result<()> {
        self.gather()?;
        for (i, rows) in wavefront.parts() {
            let stage = wavefront.stages()[i];
            let height = self.state().plan.levels[stage.level().unwrap_or(0)].height;
            before(stage, rows.len() as f64 / height as f64)?;
            let steps = self.steps_of(stage, rows.start as u32..rows.end as u32)?;
            self.perform(stage, &steps)?;
            self.keep_up().await?;
        }
        Ok(())
    }

    /// The steps of `stage` for these rows, recorded on first use.
    fn steps_of(&mut self, stage: Stage, rows: Range<u32>) -> Result<Arc<[Step]>> {
        let mut state = self.state.take().expect("prepare comes before every stage");
        let key = (stage, rows.clone());
        let steps = match state.part_steps.get(&key) {
            Some(steps) => Ok(Arc::clone(steps)),
            None => {
                self.recorded(stage.level().unwrap_or(0), &state.plan, &state.buffers, None, |recorder| {
                    recorder.only = Some(rows);
                    record(recorder, stage)
                })
            }
        };
        if let Ok(steps) = &steps {
            state.part_steps.insert(key, Arc::clone(steps));
        }
        self.state = Some(state);
        steps
    }
}
