//! The schedule: levels, iterations, convergence and the order of stages are decided here only.

use super::{Run, Step};
use crate::options::Order;
use crate::plan::{Phase, Plan};
use crate::program::View;
use crate::stage::Stage;
use std::iter;

/// All steps of a match in one piece, of the left view only.
#[must_use]
pub(crate) fn steps(plan: &Plan) -> Vec<Step> {
    let mut steps = vec![Step::Condition, Step::Enter(0)];
    steps.extend(looks(plan));
    steps.extend(post_processing(plan));
    steps.extend([Step::Ask(View::Left), Step::Collect]);
    steps
}

/// From a prepared pair to the disparities of the last look.
pub(crate) fn looks(plan: &Plan) -> Vec<Step> {
    let mut steps = estimate(plan);
    for look in 1..plan.looks() {
        steps.extend(between_looks(plan));
        steps.extend((0..plan.levels.len()).map(|z| Step::of(Stage::Guess(z))));
        steps.extend(message_passing(plan, look));
    }
    steps
}

/// The first look: from a prepared pair to the disparities of the left view, and to the labels of the right view if these are
/// computed from the beliefs.
#[must_use]
pub(crate) fn estimate(plan: &Plan) -> Vec<Step> {
    look(plan, 0)
}

/// A look, counted from 0 on, at a pair that was just prepared.
#[must_use]
pub(crate) fn look(plan: &Plan, look: u32) -> Vec<Step> {
    let levels = 0..plan.levels.len();
    let graphs = levels.clone().filter(|&z| plan.floods(z)).map(Stage::Graph);
    let costs = levels.flat_map(|z| {
        let cost = if z == 0 { Stage::Cost } else { Stage::Pyramid(z) };
        iter::once(cost).chain(plan.limits_labels().then_some(Stage::LabelRange(z)))
    });
    let mut steps: Vec<Step> = graphs.chain(costs).map(Step::of).collect();
    steps.extend(message_passing(plan, look));
    steps
}

/// The map stages between two looks: those that smooth measured pixels, and the full size, are only needed after the last one.
pub(crate) fn between_looks(plan: &Plan) -> Vec<Step> {
    let fills = |step: &Step| !matches!(step.stage(), Some(Stage::Median | Stage::Plane | Stage::Enlarge));
    post_processing(plan).into_iter().filter(fills).collect()
}

/// The steps from the first map stage after the last look on.
pub(crate) fn after_looks(steps: &[Step]) -> usize {
    let last = steps.iter().rposition(|step| step.stage() == Some(Stage::WinnerTakesAll)).unwrap_or(0);
    let is_of_maps = |step: &Step| step.stage().is_some_and(Stage::is_of_maps);
    steps[last..].iter().position(is_of_maps).map_or(steps.len(), |maps| last + maps)
}

/// Message passing and read-out of a look, counted from 0 on.
fn message_passing(plan: &Plan, look: u32) -> Vec<Step> {
    let right = plan.reads_right_view().then_some(Stage::RightView);
    let between_labels = if plan.full.is_some() { Stage::Refine } else { Stage::SubPixel };
    let lead = (look > 0).then_some(Stage::Lead);
    let read_out = iter::once(Stage::WinnerTakesAll).chain(lead).chain(right).chain([between_labels]);
    let mut steps = flood(plan, look, |plan, z| join(plan, look, z));
    steps.extend(read_out.map(Step::of));
    steps
}

/// The steps when level `z` of `plan` joins the flooding of a look: they set its labels and their evidence.
#[must_use]
pub fn join(plan: &Plan, look: u32, z: usize) -> Vec<Step> {
    let prior = (plan.prior || look > 0).then_some(Stage::Prior(z));
    [Stage::LabelWindow(z), Stage::Evidence(z)].into_iter().chain(prior).map(Step::of).collect()
}

/// The flooding of a look, counted from 0 on, by `plan`; `join` returns the steps for each level that joins, coarsest first. Each look
/// after the first has one iteration per phase.
pub fn flood(plan: &Plan, look: u32, join: impl Fn(&Plan, usize) -> Vec<Step>) -> Vec<Step> {
    let mut steps = Vec::new();
    let mut joined = plan.levels.len();
    let most = if look == 0 { u32::MAX } else { 1 };
    for phase in plan.phases.iter().map(|phase| Phase { iterations: phase.iterations.min(most), ..*phase }) {
        steps.extend((phase.finest..joined).rev().flat_map(|z| join(plan, z)));
        joined = phase.finest;
        steps.extend(joining(plan, &phase).map(Step::of));
        let may_settle = plan.settled_change().is_some() && phase.finest == 0;
        let change = || may_settle.then_some(Step::of(Stage::Change));
        steps.extend(change());
        for i in 0..phase.iterations {
            steps.extend(iteration(plan, &phase, i).map(Step::of));
            steps.push(Step::Iteration);
            steps.extend(change());
            steps.extend(may_settle.then_some(Step::Settled));
        }
        steps.extend(may_settle.then_some(Step::EndOfPhase));
    }
    steps
}

/// The stages that pass information from coarser levels to the one that joins in a phase, before its own messages. The
/// coarser level's beliefs include its messages too, or the next resolution would subtract messages that they lack.
fn joining(plan: &Plan, phase: &Phase) -> impl Iterator<Item = Stage> + use<> {
    let (joining, above) = (phase.finest, phase.finest + 1);
    let is_alone = above == plan.levels.len() || plan.phases.len() == 1;
    let stages = [Stage::Resolution(above), Stage::Belief(joining), Stage::Belief(above)];
    stages.into_iter().filter(move |_| !is_alone)
}

/// The stages of iteration `i`, from 0 on, of a phase. Every message is computed from old beliefs: first
/// those between levels, then those within a level and its new beliefs.
fn iteration(plan: &Plan, phase: &Phase, i: u32) -> impl Iterator<Item = Stage> + use<> {
    let (finest, coarsest) = (phase.finest, plan.levels.len() - 1);
    // The coarsest levels that exchange messages with the next finer one, and that are flooded.
    let (exchanged, flooded) = match plan.method.schedule.order {
        Order::Together => (coarsest, coarsest),
        // Joining has just exchanged these messages; repeating it would give the same ones.
        Order::CoarseFirst if finest > 0 => (if i == 0 { finest } else { coarsest }, coarsest),
        // The coarser levels have settled, and alternate with level 0. Levels too far away to reach level 0
        // in the remaining iterations are skipped.
        Order::CoarseFirst => {
            let reach = coarsest.min((phase.iterations / 2 - i / 2) as usize);
            if i.is_multiple_of(2) { (0, reach) } else { (reach, 0) }
        }
    };
    (finest + 1..=exchanged).map(Stage::Resolution).chain((finest..=flooded).map(Stage::Flood))
}

/// The map stages that `plan` uses, in the order of the table.
#[must_use]
pub(crate) fn post_processing(plan: &Plan) -> Vec<Step> {
    let taken = Stage::OF_MAPS.iter().filter(|stage| stage.is_taken(plan));
    taken.copied().map(Step::of).collect()
}

/// Splits a flooding at one level into messages and beliefs, for backends that compute them separately.
#[must_use]
pub(crate) fn split(run: Run) -> Vec<Run> {
    match run.stage {
        Stage::Flood(z) => {
            [Stage::Dependency(z), Stage::Belief(z)].map(|stage| Run { stage, ..run.clone() }).into()
        }
        _ => vec![run],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{DisparityRange, PRESETS};

    #[test]
    fn levels_have_a_graph_where_their_factors_send_messages() {
        for preset in PRESETS {
            let range = DisparityRange::new(0, 20).unwrap();
            let plan = Plan::new(80, 60, range, &preset.method()).unwrap();
            let steps = estimate(&plan);
            let runs = |stage: Stage| steps.contains(&Step::of(stage));
            for z in 0..plan.levels.len() {
                assert_eq!(runs(Stage::Graph(z)), runs(Stage::Flood(z)), "{}, level {z}", preset.name);
            }
        }
    }
}
