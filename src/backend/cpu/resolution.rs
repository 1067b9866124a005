//! Messages of the resolution factors: see [`crate::backend::Stage::Resolution`].
//!
//! Rows of labels are processed with their padding; values that belong to no label count as infinite.

use super::units::{
    Blocks, Truncating, Units, block, block_mut, each_lane, keep_least, least_of, padding, smallest,
};
use super::volumes::{Level, Volumes};
use crate::plan::{LABEL_BLOCK, Truncation, TruncationRule};
use rayon::prelude::*;
use std::mem;

struct Scratch<U> {
    /// q of the parent, by coarse label.
    parent: Vec<U>,
    /// q of each child, padded with infinity: the fine label that agrees best with coarse label z is at 2 z +
    /// 1.
    child: [Vec<U>; 4],
    /// U of each child, \[child\]\[coarse label\]; 0 for a child outside the image.
    best: [Vec<U>; 4],
    /// The message to the parent before its truncation, and t of each child followed by an infinite value.
    sums: [Vec<U>; 5],
    /// The message to each child before its truncation; the fine label that agrees best with coarse label z
    /// is at 2 z.
    fine: [Vec<U>; 4],
}

/// The data shared by all factors between two levels.
struct Between<U> {
    cut: Truncation,
    interpolating: bool,
    /// Fine label 2 z - `lead` agrees best with coarse label z; 0 or 1.
    lead: usize,
    fine_stride: usize,
    coarse_stride: usize,
    fine_padding: Vec<U>,
    coarse_padding: Vec<U>,
}

pub(super) fn run<U: Units>(v: &mut Volumes<U>, level: usize) {
    let plan = &v.plan;
    let (finer, coarser) = v.levels.split_at_mut(level);
    let (Level { belief: fine_belief, down, .. }, coarse) = (&mut finer[level - 1], &mut coarser[0]);
    let Level { belief: coarse_belief, up, resolution_sent, .. } = coarse;
    // The first messages count as 0, whatever is stored.
    let initial = !mem::replace(resolution_sent, true);
    let (fl, cl) = (&plan.levels[level - 1], &plan.levels[level]);
    let between = Between {
        cut: plan.resolution,
        interpolating: plan.interpolating(),
        lead: plan.label_offset(level).unsigned_abs() as usize,
        fine_stride: fl.stride,
        coarse_stride: cl.stride,
        fine_padding: padding(fl.labels, fl.stride),
        coarse_padding: padding(cl.labels, cl.stride),
    };
    let rows = up
        .par_chunks_mut(cl.width * cl.stride)
        .zip(down.par_chunks_mut(2 * fl.width * fl.stride))
        .enumerate();
    rows.for_each_init(
        || {
            let coarse = || vec![U::MOST; cl.stride + 1];
            Scratch {
                parent: vec![U::MOST; cl.stride],
                // Long enough for the padding of both levels.
                child: [(); 4].map(|()| vec![U::MOST; (2 * cl.stride).max(fl.stride) + 4]),
                best: [(); 4].map(|()| vec![U::MOST; cl.stride]),
                sums: [(); 5].map(|()| coarse()),
                fine: [(); 4].map(|()| vec![U::MOST; (2 * cl.stride).max(fl.stride) + 2]),
            }
        },
        |scratch, (y, (up, down))| {
            if initial {
                up.fill(U::default());
                down.fill(U::default());
            }
            let coarse = coarse_belief[y * cl.width * cl.stride..].chunks_exact(cl.stride);
            let fine = &fine_belief[2 * y * fl.width * fl.stride..];
            for (x, (up, belief)) in up.chunks_exact_mut(cl.stride).zip(coarse).enumerate() {
                // The position of each child in the rows of this factor.
                let children = [0, 1, 2, 3].map(|c| {
                    let (fx, j) = (2 * x + c % 2, c / 2);
                    let inside = fx < fl.width && 2 * y + j < fl.height;
                    inside.then_some((j * fl.width + fx) * fl.stride)
                });
                factor(&between, children, fine, belief, down, up, scratch);
            }
        },
    );
}

#[inline(always)]
fn factor<U: Units>(
    between: &Between<U>,
    children: [Option<usize>; 4],
    fine_belief: &[U],
    coarse_belief: &[U],
    down: &mut [U],
    up: &mut [U],
    Scratch { parent, child, best, sums, fine }: &mut Scratch<U>,
) {
    let Between { cut, interpolating, lead, fine_stride, coarse_stride, .. } = *between;
    variable_message(coarse_belief, up, parent, &between.coarse_padding, cut);
    // Values written at one alignment and read at another go through memory, so everything is written before
    // it is read.
    for (place, child) in children.into_iter().zip(child.iter_mut()) {
        if let Some(at) = place {
            let (belief, old) = (&fine_belief[at..][..fine_stride], &down[at..][..fine_stride]);
            variable_message(belief, old, &mut child[1 + lead..][..fine_stride], &between.fine_padding, cut);
        }
    }
    for ((place, child), best) in children.into_iter().zip(child.iter()).zip(best.iter_mut()) {
        if place.is_none() {
            best.fill(U::default());
            continue;
        }
        for z in (0..coarse_stride).step_by(LABEL_BLOCK) {
            agreeing(block(child, 2 * z), interpolating, block_mut(best, z));
        }
    }
    // Saturated sums cannot be undone by subtraction, so each sum is taken over the others.
    let mut least = [U::MOST; LABEL_BLOCK];
    for z in (0..coarse_stride).step_by(LABEL_BLOCK) {
        let [u0, u1, u2, u3] = best.each_ref().map(|best| *block::<U, LABEL_BLOCK>(best, z));
        let parent = *block::<U, LABEL_BLOCK>(parent, z);
        let add =
            |a: [U; LABEL_BLOCK], b: [U; LABEL_BLOCK]| -> [U; LABEL_BLOCK] { each_lane(|i| a[i].plus(b[i])) };
        let (upper, lower) = (add(u0, u1), add(u2, u3));
        let (with_upper, with_lower) = (add(parent, upper), add(parent, lower));
        let all = [
            add(upper, lower),
            add(u1, with_lower),
            add(u0, with_lower),
            add(u3, with_upper),
            add(u2, with_upper),
        ];
        keep_least(&mut least, &all[0]);
        for (sums, all) in sums.iter_mut().zip(all) {
            *block_mut(sums, z) = all;
        }
    }
    // The padding of the sums to the parent is infinite, because everything that agrees with it is.
    Truncating::new(&sums[0], least_of(&[least])[0], cut, up).all(coarse_stride);
    for ((place, t), fine) in children.into_iter().zip(&sums[1..]).zip(fine.iter_mut()) {
        if place.is_some() {
            for z in (0..coarse_stride).step_by(LABEL_BLOCK) {
                spread(block(t, z), interpolating, block_mut(fine, 2 * z));
            }
        }
    }
    let fine = fine.each_ref().map(|fine| &fine[lead..][..fine_stride]);
    let mut least = [[U::MOST; LABEL_BLOCK]; 4];
    for d in (0..fine_stride).step_by(LABEL_BLOCK) {
        let padding = block::<U, LABEL_BLOCK>(&between.fine_padding, d);
        for (least, fine) in least.iter_mut().zip(fine) {
            let sums = block::<U, LABEL_BLOCK>(fine, d);
            keep_least(least, &each_lane::<U, LABEL_BLOCK>(|i| sums[i].max(padding[i])));
        }
    }
    for ((place, fine), least) in children.into_iter().zip(fine).zip(least_of(&least)) {
        let Some(at) = place else { continue };
        Truncating::new(fine, least, cut, &mut down[at..][..fine_stride]).all(fine_stride);
    }
}

/// The smallest q of the fine labels that agree with each coarse label; `around` holds those below, at and
/// above the centres.
#[inline(always)]
fn agreeing<U: Units>(around: &[U; 2 * LABEL_BLOCK + 1], interpolating: bool, best: &mut [U; LABEL_BLOCK]) {
    let [below, at] = U::deinterleave(block(around, 0));
    if interpolating {
        let [_, above] = U::deinterleave(block(around, 1));
        *best = each_lane(|i| below[i].min(at[i]).min(above[i]));
    } else {
        *best = at;
    }
}

/// The sums for the fine labels, from the coarse labels that agree with them.
#[inline(always)]
fn spread<U: Units>(t: &[U; LABEL_BLOCK + 1], interpolating: bool, fine: &mut [U; 2 * LABEL_BLOCK]) {
    let at = *block(t, 0);
    if interpolating {
        let above: &[U; LABEL_BLOCK] = block(t, 1);
        U::interleave(at, each_lane(|i| at[i].min(above[i])), fine);
    } else {
        U::interleave(at, [U::MOST; LABEL_BLOCK], fine);
    }
}

/// q: the belief minus the factor's old message; infinite where there is no label.
#[inline(always)]
fn variable_message<U: Units>(belief: &[U], message: &[U], q: &mut [U], padding: &[U], cut: Truncation) {
    for at in (0..belief.len()).step_by(LABEL_BLOCK) {
        let (b, m) = (block::<U, LABEL_BLOCK>(belief, at), block::<U, LABEL_BLOCK>(message, at));
        let padding = block::<U, LABEL_BLOCK>(padding, at);
        *block_mut(q, at) = each_lane::<U, LABEL_BLOCK>(|i| b[i].less(m[i]).max(padding[i]));
    }
    if cut.rule == TruncationRule::Absolute {
        let least = smallest(q);
        for (q, &padding) in q.iter_mut().zip(padding) {
            *q = q.less(least).max(padding);
        }
    }
}
