//! Messages of the dependency factors: see [`crate::backend::Stage::Dependency`].
//!
//! A factor reads old beliefs and its own old messages and writes its own messages only, so flooding is exact in
//! place. Padding labels go through the same arithmetic as labels; their evidence is the largest there is, so by
//! induction no message or belief of theirs is ever below a label's, and no minimum is theirs alone.

use super::message::Message;
use crate::graph::LevelGraph;
use crate::plan::{CutRule, Plan};
use rayon::prelude::*;

struct Scratch<S> {
    /// q of each member, \[member\]\[label\].
    q: Vec<S>,
    /// Sum of q over the members.
    total: Vec<S>,
    members: Vec<(usize, usize)>,
}

pub(super) fn run<M: Message>(
    plan: &Plan,
    level: usize,
    graph: &LevelGraph,
    belief: &[u16],
    messages: &mut [M],
) {
    let l = &plan.levels[level];
    let (stride, slots) = (l.stride, graph.slots());
    let cut = plan.dependency;
    messages.par_chunks_mut(l.width * slots * stride).enumerate().for_each_init(
        || Scratch::<M::Sum> {
            q: vec![M::Sum::default(); slots * stride],
            total: vec![M::Sum::default(); stride],
            members: Vec::with_capacity(slots),
        },
        |Scratch { q, total, members }, (y, row)| {
            for (x, messages) in row.chunks_exact_mut(slots * stride).enumerate() {
                let factor = y * l.width + x;
                members.clear();
                members.extend((0..slots).filter_map(|s| graph.member(factor, s).map(|pixel| (s, pixel))));
                if members.len() < 2 {
                    continue;
                }
                total.fill(M::Sum::default());
                for (q, &(slot, pixel)) in q.chunks_exact_mut(stride).zip(members.iter()) {
                    let b = &belief[pixel * stride..][..stride];
                    let f = &messages[slot * stride..][..stride];
                    for ((q, &b), &f) in q.iter_mut().zip(b).zip(f) {
                        let f: u16 = f.into();
                        *q = M::Sum::from(b - f);
                    }
                    if cut.rule == CutRule::Absolute {
                        let min = q.iter().copied().min().unwrap_or_default();
                        for q in q.iter_mut() {
                            *q = *q - min;
                        }
                    }
                    for (total, &q) in total.iter_mut().zip(q.iter()) {
                        *total = *total + q;
                    }
                }
                for (q, &(slot, _)) in q.chunks_exact(stride).zip(members.iter()) {
                    let sums = total.iter().zip(q);
                    let min = sums.clone().map(|(&t, &q)| t - q).min().unwrap_or_default();
                    let (high, low) = cut.bounds(min.into());
                    let (high, low) = (M::sum_from_u32(high), M::sum_from_u32(low));
                    let out = &mut messages[slot * stride..][..stride];
                    for (out, (&t, &q)) in out.iter_mut().zip(sums) {
                        *out = M::from_sum((t - q).min(high) - low);
                    }
                }
            }
        },
    );
}
