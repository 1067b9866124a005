//! Messages of the resolution factors: see [`crate::backend::Stage::Resolution`].

use super::message::Message;
use crate::plan::{Cut, CutRule, Plan};
use rayon::prelude::*;

/// Stands for "agrees with no label"; sums saturate here.
const INFINITE: u32 = 1 << 20;

struct Scratch {
    /// q of the parent, by coarse label.
    parent: Vec<u32>,
    /// q of one child, by fine label.
    child: Vec<u32>,
    /// U of each child, \[child\]\[coarse label\].
    best: Vec<u32>,
    /// Sum of q of the parent and U of all children, not saturated.
    total: Vec<u32>,
    /// A message before its cut.
    sum: Vec<u32>,
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
    let offset = plan.label_offset(level);
    let reach = i32::from(plan.interpolating());
    let cut = plan.resolution;
    let rows = up
        .par_chunks_mut(cl.width * cl.stride)
        .zip(down.par_chunks_mut(2 * fl.width * fl.stride))
        .enumerate();
    rows.for_each_init(
        || Scratch {
            parent: vec![0; cl.labels],
            child: vec![0; fl.labels],
            best: vec![0; 4 * cl.labels],
            total: vec![0; cl.labels],
            sum: vec![0; fl.labels.max(cl.labels)],
        },
        |Scratch { parent, child, best, total, sum }, (y, (up, down))| {
            for (x, up) in up.chunks_exact_mut(cl.stride).enumerate() {
                let belief = &coarse_belief[(y * cl.width + x) * cl.stride..];
                variable_message(belief, up, parent, cut);
                total.copy_from_slice(parent);
                let children = (0..4)
                    .map(|c| (2 * x + c % 2, c / 2))
                    .filter(|&(fx, j)| fx < fl.width && 2 * y + j < fl.height);
                for ((fx, j), best) in children.clone().zip(best.chunks_exact_mut(cl.labels)) {
                    let belief = &fine_belief[((2 * y + j) * fl.width + fx) * fl.stride..];
                    variable_message(belief, &down[(j * fl.width + fx) * fl.stride..], child, cut);
                    for (z, (best, total)) in best.iter_mut().zip(total.iter_mut()).enumerate() {
                        let centre = 2 * z as i32 + offset;
                        let low = (centre - reach).max(0) as usize;
                        let high = (centre + reach + 1).clamp(0, fl.labels as i32) as usize;
                        *best = if low < high {
                            child[low..high].iter().copied().min().unwrap_or(INFINITE)
                        } else {
                            INFINITE
                        };
                        *total += *best;
                    }
                }
                for (sum, (t, q)) in sum.iter_mut().zip(total.iter().zip(parent.iter())) {
                    *sum = (t - q).min(INFINITE);
                }
                write_message(&sum[..cl.labels], cut, up);
                for ((fx, j), best) in children.zip(best.chunks_exact(cl.labels)) {
                    let to_child = |z: i32| (total[z as usize] - best[z as usize]).min(INFINITE);
                    for (d, sum) in sum[..fl.labels].iter_mut().enumerate() {
                        let twice = d as i32 - offset;
                        *sum = if twice % 2 == 0 {
                            to_child(twice / 2)
                        } else if reach == 1 {
                            to_child(twice / 2).min(to_child(twice / 2 + 1))
                        } else {
                            INFINITE
                        };
                    }
                    write_message(
                        &sum[..fl.labels],
                        cut,
                        &mut down[(j * fl.width + fx) * fl.stride..][..fl.stride],
                    );
                }
            }
        },
    );
}

/// q: the belief less the factor's old message.
fn variable_message<M: Message>(belief: &[u16], message: &[M], q: &mut [u32], cut: Cut) {
    for ((q, &b), &m) in q.iter_mut().zip(belief).zip(message) {
        let m: u32 = m.into();
        *q = u32::from(b) - m;
    }
    if cut.rule == CutRule::Absolute {
        let min = q.iter().copied().min().unwrap_or(0);
        for q in q.iter_mut() {
            *q -= min;
        }
    }
}

/// Cuts `sum` into `out`; padding gets the largest message there is.
fn write_message<M: Message>(sum: &[u32], cut: Cut, out: &mut [M]) {
    let min = sum.iter().copied().min().unwrap_or(0);
    let (high, low) = cut.bounds(min);
    for (out, &s) in out.iter_mut().zip(sum) {
        *out = M::from_u32(if min == INFINITE { 0 } else { s.min(high) - low });
    }
    out[sum.len()..].fill(M::from_u32(cut.tau.into()));
}
