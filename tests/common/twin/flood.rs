use super::belief::belief;
use super::dependency::dependency;
use mrfgs::low_level::graph::LevelGraph;
use mrfgs::low_level::plan::Plan;
use std::ops::Range;

/// New dependency messages of `level`, and the new beliefs, from the old messages and beliefs; `others` are
/// the evidence and the messages from the coarser and the finer level.
pub fn flood(
    plan: &Plan,
    level: usize,
    graph: &LevelGraph,
    has: &[Range<usize>],
    (beliefs, messages): (&[u32], &[u32]),
    [evidence, down, up]: [&[u32]; 3],
) -> (Vec<u32>, Vec<u32>) {
    let messages = dependency(plan, level, graph, has, beliefs, messages);
    let beliefs = belief(plan, level, graph, has, evidence, &messages, [down, up]);
    (beliefs, messages)
}
