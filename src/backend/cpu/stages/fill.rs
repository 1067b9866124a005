//! Fills invalid pixels from the farther of two neighbours: see [`crate::backend::Stage::Fill`].

use crate::image::Pair;
use crate::maps::flag;
use crate::options::Nearer;
use crate::plan::Plan;
use crate::stage::MapSet;
use crate::threads::prelude::*;

pub(super) fn run(maps: &mut MapSet, plan: &Plan, _: &Pair) {
    let farther = match plan.method.refinement.nearer {
        Nearer::Larger => i32::min,
        Nearer::Smaller => i32::max,
    };
    let MapSet { disparity, validity: flags, .. } = maps;
    let (width, height) = disparity.size();
    let valid_rows: Vec<usize> =
        (0..height).filter(|&y| flags.row(y).iter().any(|f| f & flag::INVALID == 0)).collect();
    if valid_rows.is_empty() {
        return;
    }
    let filled_rows: Vec<Vec<i32>> =
        valid_rows.par_iter().map(|&y| fill_row(disparity.row(y), flags.row(y), farther)).collect();
    let rows = disparity.data_mut().par_chunks_mut(width).zip(flags.data_mut().par_chunks_mut(width));
    rows.enumerate().for_each(|(y, (disparity, flags))| {
        let below = valid_rows.partition_point(|&row| row < y);
        let either = below.saturating_sub(1)..valid_rows.len().min(below + 1);
        let nearest = either.min_by_key(|&i| valid_rows[i].abs_diff(y)).unwrap_or(0);
        for ((disparity, flags), &source) in disparity.iter_mut().zip(flags).zip(&filled_rows[nearest]) {
            if *flags & flag::INVALID != 0 && *flags & flag::MASKED == 0 {
                *disparity = source;
                *flags |= flag::FILLED;
            }
        }
    });
}

/// Fills the invalid pixels of a row that has at least one valid one.
fn fill_row(disparity: &[i32], flags: &[u8], farther: fn(i32, i32) -> i32) -> Vec<i32> {
    let is_valid = |flags: &u8| flags & flag::INVALID == 0;
    let mut filled = disparity.to_vec();
    // Beyond the first and the last valid pixel, the only neighbour counts as both.
    let mut nearest = flags.iter().position(is_valid).map_or(0, |first| disparity[first]);
    for (value, flags) in filled.iter_mut().zip(flags) {
        nearest = if is_valid(flags) { *value } else { nearest };
        *value = nearest;
    }
    for (value, flags) in filled.iter_mut().zip(flags).rev() {
        nearest = if is_valid(flags) { *value } else { nearest };
        *value = farther(*value, nearest);
    }
    filled
}
