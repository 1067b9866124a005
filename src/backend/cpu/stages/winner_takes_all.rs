//! Winner takes all: the optimum of the beliefs. See [`crate::backend::Stage::WinnerTakesAll`].

use crate::backend::cpu::units::{Units, argmin, smallest};
use crate::backend::cpu::volumes::{Level, Volumes};
use crate::backend::cpu::windows::Windows;
use crate::stage::NO_RUNNER_UP;
use crate::stage::Optimum;
use crate::threads::prelude::*;
use std::ops::Range;

/// Computes the optima of `rows`.
pub(super) fn rows<U: Units>(v: &mut Volumes<U>, rows: Range<usize>) {
    let (width, Level { belief, windows, .. }) = (v.plan.levels[0].width, &v.levels[0]);
    let optima = v.maps.optima.rows_mut(rows.clone()).par_chunks_mut(width);
    optima.zip(rows).for_each(|(optima, y)| optimum_row(windows, y, windows.row_of(belief, y), optima));
}

#[pulp::with_simd(optimum_row = crate::vectors::widest())]
#[inline(always)]
fn optimum_row_on<'a, S: pulp::Simd, U: Units>(
    _: S,
    windows: &'a Windows,
    y: usize,
    beliefs: &'a [U],
    optima: &'a mut [Optimum],
) {
    let row = windows.row(y);
    for (x, optimum) in optima.iter_mut().enumerate() {
        let window = row[x];
        *optimum = optimum_of(&beliefs[window.cells()], windows.labels(window));
        optimum.label += window.first() as u16;
    }
}

/// The optimum of the beliefs in one window, with its label relative to the first. The belief of padding is
/// the largest value, and comes after all `labels`.
#[inline(always)]
fn optimum_of<U: Units>(belief: &[U], labels: usize) -> Optimum {
    let (label, best) = argmin(belief);
    let belief = &belief[..labels];
    let below = &belief[..label.saturating_sub(1)];
    let above = belief.get(label + 2..).unwrap_or_default();
    let runner_up = if below.is_empty() && above.is_empty() {
        NO_RUNNER_UP
    } else {
        smallest(below).min(smallest(above)).into()
    };
    Optimum { label: label as u16, best: best.into(), runner_up }
}
