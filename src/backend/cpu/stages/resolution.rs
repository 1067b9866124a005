//! Messages of the resolution factors: see [`crate::backend::Stage::Resolution`].
//!
//! Rows of labels are processed with their padding; values that belong to no label count as infinite.

use crate::backend::cpu::units::{
    Units, block, block_mut, each_lane, keep_least, padding, smallest, truncate,
};
use crate::backend::cpu::volumes::{Level, Volumes};
use crate::backend::cpu::windows::{Window, Windows};
use crate::plan::{LABEL_BLOCK, Truncation, TruncationRule};
use crate::program::Sent;
use crate::threads::prelude::*;
use std::ops::Range;

struct Scratch<U> {
    /// (first label, number of cells) of the windows of the parent and the children; `child` and `fine` are
    /// infinite outside them.
    windows: Option<[(usize, usize); 2]>,
    /// q of the parent, by label of its window.
    parent: Vec<U>,
    /// q of each child; the fine label that agrees best with label z of the parent's window is at `margin` + 2 z + 1.
    child: [Vec<U>; 4],
    /// U of each child, \[child\]\[label of the parent's window\]; 0 for a child outside the image.
    best: [Vec<U>; 4],
    /// The message to the parent before truncation, and t of each child followed by an infinite value.
    sums: [Vec<U>; 5],
    /// The message to each child before truncation; the fine label that agrees best with label z is at `margin` + 2 z.
    fine: [Vec<U>; 4],
}

/// Data shared by all factors between two levels.
struct Between<U> {
    cut: Truncation,
    interpolating: bool,
    /// Fine label 2 z - `lead` agrees best with coarse label z; 0 or 1.
    lead: usize,
    /// Cells before the parent's window, enough for every window of a child.
    margin: usize,
    fine_padding: Vec<U>,
    coarse_padding: Vec<U>,
}

/// The messages of the factors of the coarse `rows`.
pub(super) fn rows<U: Units>(v: &mut Volumes<U>, level: usize, sent: Sent, rows: Range<usize>) {
    let plan = &v.plan;
    let (finer, coarser) = v.levels.split_at_mut(level);
    let (Level { belief: fine_belief, down, windows: fine_windows, .. }, coarse) =
        (&mut finer[level - 1], &mut coarser[0]);
    let Level { belief: coarse_belief, up, windows, .. } = coarse;
    let (fl, cl) = (&plan.levels[level - 1], &plan.levels[level]);
    let between = Between {
        cut: plan.resolution,
        interpolating: plan.interpolating(),
        lead: plan.label_offset(level).unsigned_abs() as usize,
        margin: 2 * cl.stride,
        fine_padding: padding(fl.labels, fl.stride),
        coarse_padding: padding(cl.labels, cl.stride),
    };
    let fine_rows = 2 * rows.start..fl.height.min(2 * rows.end);
    let ups = windows.rows_mut(up, 1, 1, rows.clone()).into_par_iter();
    ups.zip(fine_windows.rows_mut(down, 1, 2, fine_rows)).zip(rows).for_each_init(
        || {
            let infinite = |n: usize| vec![U::MOST; n];
            let fine = || infinite(between.margin + 2 * cl.stride + fl.stride + 4);
            Scratch {
                windows: None,
                parent: infinite(cl.stride),
                child: [(); 4].map(|()| fine()),
                best: [(); 4].map(|()| infinite(cl.stride)),
                sums: [(); 5].map(|()| infinite(cl.stride + 1)),
                fine: [(); 4].map(|()| fine()),
            }
        },
        |scratch, ((up, down), y)| {
            // The first messages count as 0, whatever is stored.
            if !sent.below {
                up.fill(U::default());
                down.fill(U::default());
            }
            let coarse = windows.row_of(coarse_belief, y);
            let fine = &fine_belief[fine_windows.start(2 * y)..][..down.len()];
            row(&between, [fine_windows, windows], [fine, coarse], y, down, up, scratch);
        },
    );
}

/// The messages of the factors of coarse row `y`, from the windows and the beliefs of the finer and the coarser level.
#[pulp::with_simd(row = crate::vectors::widest())]
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "volumes of both levels")]
fn row_on<'a, S: pulp::Simd, U: Units>(
    _: S,
    between: &'a Between<U>,
    [fine_windows, windows]: [&'a Windows; 2],
    [fine_belief, coarse_belief]: [&'a [U]; 2],
    y: usize,
    down: &'a mut [U],
    up: &'a mut [U],
    scratch: &'a mut Scratch<U>,
) {
    let start = fine_windows.start(2 * y);
    let theirs = fine_windows.row(2 * y);
    for (x, &own) in windows.row(y).iter().enumerate() {
        // All children share a window.
        let theirs = &theirs[2 * x..];
        let child = |dx: usize, dy: usize| {
            let inside = dx < theirs.len() && 2 * y + dy < fine_windows.height();
            inside.then(|| fine_windows.start(2 * y + dy) - start + theirs[dx].start())
        };
        let children = [child(0, 0), child(1, 0), child(0, 1), child(1, 1)];
        let (up, belief) = (&mut up[own.cells()], &coarse_belief[own.cells()]);
        factor(between, [own, theirs[0]], children, fine_belief, belief, down, up, scratch);
    }
}

/// The messages of the factor between a pixel and its children, with the windows `own` and `theirs`;
/// `children` are the start indices of their cells.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "volumes of both levels")]
fn factor<U: Units>(
    between: &Between<U>,
    [own, theirs]: [Window; 2],
    children: [Option<usize>; 4],
    fine_belief: &[U],
    coarse_belief: &[U],
    down: &mut [U],
    up: &mut [U],
    Scratch { windows, parent, child, best, sums, fine }: &mut Scratch<U>,
) {
    let Between { cut, interpolating, lead, margin, .. } = *between;
    let coarse_padding = &between.coarse_padding[own.first()..][..own.stride()];
    let fine_padding = &between.fine_padding[theirs.first()..][..theirs.stride()];
    let places = Some([(own.first(), own.stride()), (theirs.first(), theirs.stride())]);
    if *windows != places {
        *windows = places;
        for infinite in child.iter_mut().chain(fine.iter_mut()) {
            infinite.fill(U::MOST);
        }
        for sums in sums.iter_mut() {
            sums[own.stride()] = U::MOST;
        }
    }
    // Index in `fine` of the children's first label.
    let first = margin + theirs.first() + lead - 2 * own.first();
    let parent = &mut parent[..own.stride()];
    variable_message(coarse_belief, up, parent, coarse_padding, cut);
    // Values that are read at another alignment than written go through memory, so all are written first.
    for (place, child) in children.into_iter().zip(child.iter_mut()) {
        if let Some(at) = place {
            let (belief, old) = (&fine_belief[at..][..theirs.stride()], &down[at..][..theirs.stride()]);
            variable_message(belief, old, &mut child[1 + first..][..theirs.stride()], fine_padding, cut);
        }
    }
    for ((place, child), best) in children.into_iter().zip(child.iter()).zip(best.iter_mut()) {
        if place.is_none() {
            best.fill(U::default());
            continue;
        }
        for z in (0..own.stride()).step_by(LABEL_BLOCK) {
            agreeing(block(child, margin + 2 * z), interpolating, block_mut(best, z));
        }
    }
    // Saturated sums cannot be undone by subtraction, so each sum is computed from the others.
    let mut least = [U::MOST; LABEL_BLOCK];
    for z in (0..own.stride()).step_by(LABEL_BLOCK) {
        let [u0, u1, u2, u3] =
            [*block(&best[0], z), *block(&best[1], z), *block(&best[2], z), *block(&best[3], z)];
        let parent = *block::<U, LABEL_BLOCK>(parent, z);
        let padding = block::<U, LABEL_BLOCK>(coarse_padding, z);
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
        keep_least(&mut least, &each_lane::<U, LABEL_BLOCK>(|i| all[0][i] | padding[i]));
        for (sums, all) in sums.iter_mut().zip(all) {
            *block_mut(sums, z) = all;
        }
    }
    truncate(&sums[0], least, cut, up);
    for ((place, t), fine) in children.into_iter().zip(&sums[1..]).zip(fine.iter_mut()) {
        if place.is_some() {
            // The label below the parent's first also agrees with it.
            fine[margin - 1] = if interpolating { t[0] } else { U::MOST };
            for z in (0..own.stride()).step_by(LABEL_BLOCK) {
                spread(block(t, z), interpolating, block_mut(fine, margin + 2 * z));
            }
        }
    }
    for (place, fine) in children.into_iter().zip(&*fine) {
        let Some(at) = place else { continue };
        let fine = &fine[first..][..theirs.stride()];
        let mut least = [U::MOST; LABEL_BLOCK];
        for d in (0..theirs.stride()).step_by(LABEL_BLOCK) {
            let (sums, padding) =
                (block::<U, LABEL_BLOCK>(fine, d), block::<U, LABEL_BLOCK>(fine_padding, d));
            keep_least(&mut least, &each_lane::<U, LABEL_BLOCK>(|i| sums[i] | padding[i]));
        }
        truncate(fine, least, cut, &mut down[at..][..theirs.stride()]);
    }
}

/// The smallest q of the fine labels that agree with each coarse label; `around` contains those below, at and
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
        *block_mut(q, at) = each_lane::<U, LABEL_BLOCK>(|i| b[i].less(m[i]) | padding[i]);
    }
    if cut.rule == TruncationRule::Absolute {
        let least = smallest(q);
        for (q, &padding) in q.iter_mut().zip(padding) {
            *q = q.less(least) | padding;
        }
    }
}
