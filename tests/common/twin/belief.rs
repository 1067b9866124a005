use super::{members, most};
use mrfgs::low_level::graph::LevelGraph;
use mrfgs::low_level::plan::Plan;

/// The largest belief: one message below the largest value.
pub fn belief_most(plan: &Plan) -> u32 {
    most(plan) - u32::from(plan.dependency.tau.max(plan.resolution.tau))
}

/// Beliefs of `level`; `down` and `up` are empty where there is no coarser or finer level.
pub fn belief(
    plan: &Plan,
    level: usize,
    graph: &LevelGraph,
    evidence: &[u32],
    dependency: &[u32],
    down: &[u32],
    up: &[u32],
) -> Vec<u32> {
    let labels = plan.levels[level].labels;
    let mut out = evidence.to_vec();
    for messages in [down, up] {
        for (b, m) in out.iter_mut().zip(messages) {
            *b += m;
        }
    }
    for factor in 0..graph.width() * graph.height() {
        for (slot, member) in members(graph, factor).into_iter().enumerate() {
            if let Some(pixel) = member {
                for d in 0..labels {
                    out[pixel * labels + d] += dependency[(factor * graph.slots() + slot) * labels + d];
                }
            }
        }
    }
    out.into_iter().map(|sum| sum.min(belief_most(plan))).collect()
}
