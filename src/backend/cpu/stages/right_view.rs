//! The map of the right view: see [`crate::backend::Stage::RightView`].

use crate::backend::cpu::units::Units;
use crate::backend::cpu::volumes::{Level, Volumes};
use crate::backend::cpu::windows::Windows;
use crate::plan::Plan;
use crate::threads::prelude::*;
use std::ops::Range;

/// Computes `rows` of the right view.
pub(super) fn rows<U: Units>(v: &mut Volumes<U>, rows: Range<usize>) {
    let (plan, maps, Level { belief, windows, .. }) = (&v.plan, &mut v.maps, &v.levels[0]);
    let masked = &v.pair.left().masked;
    let (width, labels) = (plan.levels[0].width, plan.levels[0].labels);
    let names: Vec<u32> = (0..labels as u32).collect();
    let right = maps.right.rows_mut(rows.clone()).par_chunks_mut(width);
    right.zip(maps.right_best.rows_mut(rows.clone()).par_chunks_mut(width)).zip(rows).for_each_init(
        // By position from the right, so that ascending labels are adjacent: belief and label of the best so
        // far, or all bits ([`crate::backend::NO_LABEL`] in both).
        || vec![u32::MAX; width],
        |found, ((right, best), y)| {
            found.fill(u32::MAX);
            let left = LeftRow { y, belief: windows.row_of(belief, y), masked: masked.row(y) };
            right_row(plan, windows, &names, left, found);
            for ((right, best), &found) in right.iter_mut().zip(best).zip(found.iter().rev()) {
                (*right, *best) = (found as u16, (found >> 16) as u16);
            }
        },
    );
}

/// A row of the left view.
struct LeftRow<'a, U> {
    y: usize,
    belief: &'a [U],
    masked: &'a [bool],
}

#[pulp::with_simd(right_row = crate::vectors::widest())]
#[inline(always)]
fn right_row_on<'a, S: pulp::Simd, U: Units>(
    _: S,
    plan: &'a Plan,
    windows: &'a Windows,
    names: &'a [u32],
    left: LeftRow<'a, U>,
    found: &'a mut [u32],
) {
    let (level, LeftRow { y, belief: row, masked }) = (&plan.levels[0], left);
    let width = level.width;
    for x in plan.core.clone().filter(|&x| !masked[x]) {
        let window = windows.row(y)[x];
        // Label j of left pixel x is at right pixel x - min - j.
        let place = (width - 1 - x) as i64 + i64::from(level.min);
        let labels = windows.range(window);
        let first = (-place).clamp(labels.start as i64, labels.end as i64) as usize;
        let end = (width as i64 - place).clamp(first as i64, labels.end as i64) as usize;
        if first >= end {
            continue;
        }
        let seen = (place + first as i64) as usize..(place + end as i64) as usize;
        let belief = &row[window.start() + first - window.first()..][..end - first];
        let beliefs = belief.iter().zip(&names[first..end]);
        for (found, (&b, &label)) in found[seen].iter_mut().zip(beliefs) {
            // The smallest belief, then the lowest label.
            let b: u32 = b.into();
            *found = (*found).min(b << 16 | label);
        }
    }
}
