use super::{cut, members, most, variable_message};
use mrfgs::low_level::graph::LevelGraph;
use mrfgs::low_level::plan::Plan;

/// New messages of the dependency factors of `level`.
pub fn dependency(plan: &Plan, level: usize, graph: &LevelGraph, belief: &[u32], old: &[u32]) -> Vec<u32> {
    let (labels, slots) = (plan.levels[level].labels, graph.slots());
    let mut out = vec![0; old.len()];
    for factor in 0..graph.width() * graph.height() {
        let range = |slot: usize| (factor * slots + slot) * labels..(factor * slots + slot + 1) * labels;
        // (slot, q) of each member.
        let mut present = Vec::new();
        for (slot, member) in members(graph, factor).into_iter().enumerate() {
            if let Some(pixel) = member {
                let b = &belief[pixel * labels..(pixel + 1) * labels];
                present.push((slot, variable_message(b, &old[range(slot)], plan.dependency)));
            }
        }
        for (to, _) in &present {
            let mut s = vec![0; labels];
            for (from, q) in &present {
                if from != to {
                    for d in 0..labels {
                        s[d] += q[d];
                    }
                }
            }
            let s: Vec<i64> = s.into_iter().map(|s: i64| s.min(most(plan).into())).collect();
            out[range(*to)].copy_from_slice(&cut(&s, plan.dependency));
        }
    }
    out
}
