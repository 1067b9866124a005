//! The change of the label map: see [`crate::backend::Stage::Change`].

use super::units::Units;
use super::volumes::{Level, Volumes};
use rayon::prelude::*;

pub(super) fn run<U: Units>(v: &mut Volumes<U>) {
    let (width, Level { belief, windows, .. }) = (v.plan.levels[0].width, &v.levels[0]);
    let sum = v
        .labels
        .par_chunks_mut(width)
        .enumerate()
        .map(|(y, labels)| {
            let row = windows.row_of(belief, y);
            let mut sum = 0;
            for (x, label) in labels.iter_mut().enumerate() {
                let new = windows.winner(windows.row(y)[x], row);
                sum += u64::from(new.abs_diff(*label)).pow(2);
                *label = new;
            }
            sum
        })
        .sum();
    v.settled = v.change.is_some() && v.plan.settled_change().is_some_and(|most| sum <= most);
    v.change = Some(sum);
}
