use super::{members, most};
use mrfgs::low_level::graph::LevelGraph;
use mrfgs::low_level::plan::Plan;
use std::ops::Range;

/// The largest belief: one message below the largest value.
pub fn belief_most(plan: &Plan) -> u32 {
    most(plan) - u32::from(plan.dependency.tau.max(plan.resolution.tau))
}

/// Beliefs of `level`; `down` and `up` are empty if there is no coarser or finer level.
pub fn belief(
    plan: &Plan,
    level: usize,
    graph: &LevelGraph,
    has: &[Range<usize>],
    evidence: &[u32],
    dependency: &[u32],
    [down, up]: [&[u32]; 2],
) -> Vec<u32> {
    let labels = plan.levels[level].labels;
    let is_label = |i: usize| has[i / labels].contains(&(i % labels));
    let mut out = evidence.to_vec();
    for messages in [down, up] {
        for (i, m) in messages.iter().enumerate().filter(|(i, _)| is_label(*i)) {
            out[i] += m;
        }
    }
    for factor in 0..graph.width() * graph.height() {
        for (slot, member) in members(graph, factor).into_iter().enumerate() {
            if let Some(pixel) = member {
                for d in has[pixel].clone() {
                    out[pixel * labels + d] += dependency[(factor * graph.slots() + slot) * labels + d];
                }
            }
        }
    }
    let value = |(i, sum): (usize, u32)| if is_label(i) { sum.min(belief_most(plan)) } else { most(plan) };
    out.into_iter().enumerate().map(value).collect()
}
