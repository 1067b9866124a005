//! The left-right check: see [`crate::backend::Stage::LeftRightCheck`].

use crate::image::Pair;
use crate::maps::flag;
use crate::options::LeftRightCheck;
use crate::plan::Plan;
use crate::stage::MapSet;
use crate::stage::NO_LABEL;
use crate::threads::prelude::*;

pub(super) fn run(maps: &mut MapSet, plan: &Plan, pair: &Pair) {
    let left = pair.left();
    let (width, min) = (plan.levels[0].width, i64::from(plan.range.min));
    let MapSet { optima, right, validity, .. } = maps;
    validity.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        let (optima, right, masked) = (optima.row(y), right.row(y), left.masked.row(y));
        for (x, ((flags, optimum), &masked)) in row.iter_mut().zip(optima).zip(masked).enumerate() {
            let label = optimum.label;
            let xr = x as i64 - min - i64::from(label);
            *flags = if masked {
                flag::MASKED
            } else if label == NO_LABEL {
                flag::OUTSIDE
            } else if plan.method.refinement.left_right_check == LeftRightCheck::Off {
                0
            } else if xr < 0 || xr >= width as i64 {
                flag::OUTSIDE
            } else if right[xr as usize].abs_diff(label) > 1 {
                flag::OCCLUDED
            } else {
                0
            };
        }
    });
}
