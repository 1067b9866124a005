//! The map of the right view, post-processed like the left one.

use super::{Step, View, schedule};
use crate::plan::Plan;
use crate::stage::Stage;

/// The stages that make the right view the left one, up to sub-pixel disparities.
#[must_use]
pub(crate) fn stages(plan: &Plan) -> Vec<Step> {
    let between_labels: &[_] =
        if plan.full.is_some() { &[Stage::Refine] } else { &[Stage::Cost, Stage::SubPixel] };
    [&[Stage::SwapViews], between_labels].concat().into_iter().map(Step::of).collect()
}

/// Adds the right view to `steps`, after the request for the left maps: sub-pixel disparities, map stages.
#[must_use]
pub(crate) fn follow(plan: &Plan, mut steps: Vec<Step>) -> Vec<Step> {
    // Anchors are known in the left view alone.
    let refines =
        |step: &&Step| step.stage().is_some_and(|stage| stage.is_of_maps() && stage != Stage::Anchor);
    let refining: Vec<Step> =
        steps[schedule::after_looks(&steps)..].iter().filter(refines).cloned().collect();
    let collect = steps.pop();
    steps.extend(stages(plan));
    steps.extend(refining);
    steps.push(Step::Ask(View::Right));
    steps.extend(collect);
    steps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::LeftRightCheck;
    use crate::program::samples;

    #[test]
    fn the_right_view_is_refined_like_the_left_one() {
        let plan = samples::plan(LeftRightCheck::RightView);
        let plain = schedule::steps(&plan);
        let steps = follow(&plan, plain.clone());
        let (left, right) = steps.split_at(plain.len() - 1);
        assert_eq!(left, &plain[..plain.len() - 1]);
        let mut expected = stages(&plan);
        expected.extend(schedule::post_processing(&plan));
        expected.extend([Step::Ask(View::Right), Step::Collect]);
        assert_eq!(right, expected);
    }
}
