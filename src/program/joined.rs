//! The same stage at one level after the other as one run, for backends whose levels share buffers.

use super::{Run, Step};
use crate::plan::Plan;
use crate::stage::Stage;

/// `steps` with runs of the same stage at neighbouring levels made one, where they touch no level finer than `shared`.
#[must_use]
pub fn join(plan: &Plan, shared: usize, steps: Vec<Step>) -> Vec<Step> {
    let may_join = |stage: Stage| stage.descriptor().joins && stage.finest_level(plan) >= shared;
    let mut all: Vec<Step> = Vec::new();
    for step in steps {
        if let (Some(Step::Run(last)), Step::Run(run)) = (all.last_mut(), &step) {
            let goes_on = *run == Run::from(last.stage.coarser(last.levels)) && run.stage != last.stage;
            if goes_on && last.part.is_none() && may_join(last.stage) {
                last.levels += 1;
                continue;
            }
        }
        all.push(step);
    }
    all
}
