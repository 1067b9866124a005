//! Messages of the resolution factors: see [`crate::backend::Stage::Resolution`].

use super::message::Message;
use crate::plan::{Cut, CutRule, Plan};
use rayon::prelude::*;

struct Scratch<S> {
    /// q of the parent, by coarse label.
    parent: Vec<S>,
    /// q of one child, infinite around it: at 2 z + 1 the fine label that agrees best with coarse label z.
    child: Vec<S>,
    /// U of each child, \[child\]\[coarse label\].
    best: Vec<S>,
    /// Sum of q of the parent and U of all children, not saturated.
    total: Vec<S>,
    /// The message to the parent before its cut; t of a child, and infinite after it.
    coarse: Vec<S>,
    /// The message to a child before its cut, at 2 z the fine label that agrees best with coarse label z.
    fine: Vec<S>,
}

pub(super) fn run<M: Message>(
    plan: &Plan,
    level: usize,
    fine_belief: &[u16],
    coarse_belief: &[u16],
    down: &mut [M],
    up: &mut [M],
) {
    let (fl, cl) = (&plan.levels[level - 1], &plan.levels[level]);
    // Fine labels are 2 z + offset; the offset is 0 or -1.
    let lead = plan.label_offset(level).unsigned_abs() as usize;
    let interpolating = plan.interpolating();
    let (cut, labels) = (plan.resolution, cl.labels);
    let infinite = M::INFINITE;
    let rows = up
        .par_chunks_mut(cl.width * cl.stride)
        .zip(down.par_chunks_mut(2 * fl.width * fl.stride))
        .enumerate();
    rows.for_each_init(
        || Scratch::<M::Sum> {
            parent: vec![infinite; labels],
            child: vec![infinite; 2 * labels + 2],
            best: vec![infinite; 4 * labels],
            total: vec![infinite; labels],
            coarse: vec![infinite; labels + 1],
            fine: vec![infinite; 2 * labels],
        },
        |Scratch { parent, child, best, total, coarse, fine }, (y, (up, down))| {
            for (x, up) in up.chunks_exact_mut(cl.stride).enumerate() {
                let belief = &coarse_belief[(y * cl.width + x) * cl.stride..];
                variable_message(belief, up, parent, cut);
                total.copy_from_slice(parent);
                let children = (0..4)
                    .map(|c| (2 * x + c % 2, c / 2))
                    .filter(|&(fx, j)| fx < fl.width && 2 * y + j < fl.height);
                for ((fx, j), best) in children.clone().zip(best.chunks_exact_mut(labels)) {
                    let belief = &fine_belief[((2 * y + j) * fl.width + fx) * fl.stride..];
                    let old = &down[(j * fl.width + fx) * fl.stride..];
                    variable_message(belief, old, &mut child[1 + lead..][..fl.labels], cut);
                    let around = child.chunks_exact(2).zip(child[2..].chunks_exact(2));
                    for (best, (before, after)) in best.iter_mut().zip(around) {
                        *best =
                            if interpolating { before[0].min(before[1]).min(after[0]) } else { before[1] };
                    }
                    for (total, &best) in total.iter_mut().zip(best.iter()) {
                        *total = *total + best;
                    }
                }
                for (sum, (&total, &q)) in coarse.iter_mut().zip(total.iter().zip(parent.iter())) {
                    *sum = (total - q).min(infinite);
                }
                write_message(&coarse[..labels], cut, up);
                for ((fx, j), best) in children.zip(best.chunks_exact(labels)) {
                    for (t, (&total, &best)) in coarse.iter_mut().zip(total.iter().zip(best)) {
                        *t = (total - best).min(infinite);
                    }
                    for (sums, (&t, &next)) in fine.chunks_exact_mut(2).zip(coarse.iter().zip(&coarse[1..])) {
                        sums[0] = t;
                        sums[1] = if interpolating { t.min(next) } else { infinite };
                    }
                    let out = &mut down[(j * fl.width + fx) * fl.stride..][..fl.stride];
                    write_message(&fine[lead..][..fl.labels], cut, out);
                }
            }
        },
    );
}

/// q: the belief less the factor's old message.
fn variable_message<M: Message>(belief: &[u16], message: &[M], q: &mut [M::Sum], cut: Cut) {
    for ((q, &b), &m) in q.iter_mut().zip(belief).zip(message) {
        let m: u16 = m.into();
        *q = M::Sum::from(b - m);
    }
    if cut.rule == CutRule::Absolute {
        let min = q.iter().copied().min().unwrap_or_default();
        for q in q.iter_mut() {
            *q = *q - min;
        }
    }
}

/// Cuts `sum` into `out`; padding gets the largest message there is.
fn write_message<M: Message>(sum: &[M::Sum], cut: Cut, out: &mut [M]) {
    let min = sum.iter().copied().min().unwrap_or_default();
    if min == M::INFINITE {
        out[..sum.len()].fill(M::default());
    } else {
        let (high, low) = cut.bounds(min.into());
        let (high, low) = (M::sum_from_u32(high), M::sum_from_u32(low));
        for (out, &s) in out.iter_mut().zip(sum) {
            *out = M::from_sum(s.min(high) - low);
        }
    }
    out[sum.len()..].fill(M::from_u32(cut.tau.into()));
}
