use super::{UNDEFINED, cut, members, most, variable_message};
use mrfgs::low_level::graph::LevelGraph;
use mrfgs::low_level::plan::Plan;
use std::ops::Range;

/// New messages of the dependency factors of `level`, between pixels with the labels `has`.
pub fn dependency(
    plan: &Plan,
    level: usize,
    graph: &LevelGraph,
    has: &[Range<usize>],
    belief: &[u32],
    old: &[u32],
) -> Vec<u32> {
    let (labels, slots) = (plan.levels[level].labels, graph.slots());
    let mut out = old.to_vec();
    for factor in 0..graph.width() * graph.height() {
        let range = |slot: usize| (factor * slots + slot) * labels..(factor * slots + slot + 1) * labels;
        let own = |d: usize| has[factor].contains(&d);
        // (slot, pixel, q) of each member.
        let mut present = Vec::new();
        for (slot, member) in members(graph, factor).into_iter().enumerate() {
            if let Some(pixel) = member {
                let b = &belief[pixel * labels..(pixel + 1) * labels];
                present.push((
                    slot,
                    pixel,
                    variable_message(plan, b, &old[range(slot)], own, plan.dependency),
                ));
            }
        }
        if present.len() < 2 {
            continue;
        }
        for (to, pixel, _) in &present {
            let mut s = vec![0; labels];
            for (from, _, q) in &present {
                if from != to {
                    for d in 0..labels {
                        s[d] += q[d];
                    }
                }
            }
            let s: Vec<i64> = s.into_iter().map(|s: i64| s.min(most(plan).into())).collect();
            let both = |d: usize| own(d) && has[*pixel].contains(&d);
            let s = match plan.label_step(level) {
                Some(step) => with_steps(&s, both, step),
                None => s,
            };
            let mut message = cut(plan, &s, both, plan.dependency);
            for d in has[*pixel].clone().filter(|&d| !own(d)) {
                message[d] = plan.dependency.tau.into();
            }
            out[range(*to)].copy_from_slice(&message);
        }
    }
    undefine(plan, level, graph, has, &mut out);
    out
}

/// The sums after allowing steps to adjacent labels at the cost `step`, among labels that `counts` accepts.
fn with_steps(s: &[i64], counts: impl Fn(usize) -> bool, step: u16) -> Vec<i64> {
    let near = |d: usize| {
        let next = [d.checked_sub(1), Some(d + 1)].into_iter().flatten();
        let steps = next.filter(|&e| e < s.len() && counts(e)).map(|e| s[e] + i64::from(step));
        steps.fold(s[d], i64::min)
    };
    (0..s.len()).map(near).collect()
}

/// Marks undefined dependency messages: labels that a member does not have and, in empty slots, labels that
/// the factor's own pixel does not have.
pub fn undefine(plan: &Plan, level: usize, graph: &LevelGraph, has: &[Range<usize>], messages: &mut [u32]) {
    let labels = plan.levels[level].labels;
    for (i, row) in messages.chunks_mut(labels).enumerate() {
        let (factor, slot) = (i / graph.slots(), i % graph.slots());
        let to = members(graph, factor)[slot].unwrap_or(factor);
        for d in (0..labels).filter(|d| !has[to].contains(d)) {
            row[d] = UNDEFINED;
        }
    }
}
