//! The change of the label map: see [`crate::backend::Stage::Change`].

use crate::backend::cpu::units::{Units, argmin};
use crate::backend::cpu::volumes::{Level, Volumes};
use crate::backend::cpu::windows::Window;
use crate::threads::prelude::*;

pub(super) fn run<U: Units>(v: &mut Volumes<U>) {
    let (width, Level { belief, windows, .. }) = (v.plan.levels[0].width, &v.levels[0]);
    let rows = v.labels.par_chunks_mut(width).enumerate();
    let sum = rows.map(|(y, labels)| label_row(windows.row(y), windows.row_of(belief, y), labels)).sum();
    v.settled = v.change.is_some() && v.plan.settled_change().is_some_and(|most| sum <= most);
    v.change = Some(sum);
}

/// Writes the labels of a row; returns the sum of their squared changes.
#[pulp::with_simd(label_row = crate::vectors::widest())]
#[inline(always)]
fn label_row_on<'a, S: pulp::Simd, U: Units>(
    _: S,
    windows: &'a [Window],
    belief: &'a [U],
    labels: &'a mut [u16],
) -> u64 {
    let mut sum = 0;
    for (label, window) in labels.iter_mut().zip(windows) {
        // The belief of padding is the largest value, and comes after all labels.
        let new = (window.first() + argmin(&belief[window.cells()]).0) as u16;
        sum += u64::from(new.abs_diff(*label)).pow(2);
        *label = new;
    }
    sum
}
