//! Joins runs of one stage at successive levels into one run, for backends whose levels share buffers.

use super::{Run, Step};
use crate::plan::Plan;
use crate::stage::Stage;

/// `steps` with runs of one stage at successive levels joined, if they touch no level finer than `shared`.
#[must_use]
pub(crate) fn join(plan: &Plan, shared: usize, steps: Vec<Step>) -> Vec<Step> {
    let may_join = |stage: Stage| stage.descriptor().joins && stage.finest_level(plan) >= shared;
    let mut all: Vec<Step> = Vec::new();
    for step in steps {
        if let (Some(Step::Run(last)), Step::Run(run)) = (all.last_mut(), &step) {
            let goes_on = *run == Run::from(last.stage.coarser(last.levels)) && run.stage != last.stage;
            if goes_on && last.band.is_none() && may_join(last.stage) {
                last.levels += 1;
                continue;
            }
        }
        all.push(step);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::LeftRightCheck;
    use crate::program::{samples, schedule};

    /// The steps with joined runs split by level.
    fn apart(steps: &[Step]) -> Vec<Step> {
        let apart = |step: &Step| match step {
            Step::Run(run) => run.stages().map(Step::of).collect(),
            other => vec![other.clone()],
        };
        steps.iter().flat_map(apart).collect()
    }

    #[test]
    fn only_levels_that_share_buffers_are_joined() {
        let plan = samples::plan(LeftRightCheck::RightView);
        let steps = schedule::estimate(&plan);
        let mut fewest = steps.len();
        for shared in (0..=plan.levels.len()).rev() {
            let joined = join(&plan, shared, steps.clone());
            assert_eq!(apart(&joined), steps, "levels from {shared} on");
            for step in &joined {
                let Step::Run(run) = step else { continue };
                assert!(run.levels == 1 || run.stage.finest_level(&plan) >= shared);
            }
            assert!(joined.len() <= fewest);
            fewest = joined.len();
        }
        // For example, the graphs of all levels are one run.
        assert!(fewest < steps.len() * 3 / 4, "{fewest} of {}", steps.len());
    }
}
