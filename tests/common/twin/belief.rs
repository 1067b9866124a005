use super::members;
use mrfgs::graph::LevelGraph;

/// Beliefs of a level; `down` and `up` are empty where there is no level above or below.
pub fn belief(
    graph: &LevelGraph,
    labels: usize,
    evidence: &[u32],
    dependency: &[u32],
    down: &[u32],
    up: &[u32],
) -> Vec<u32> {
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
    out
}
