//! Fills invalid pixels from the farther of two neighbours: see [`crate::backend::Stage::Fill`].

use crate::image::Pair;
use crate::maps::flag;
use crate::options::Nearer;
use crate::plan::Plan;
use crate::stage::MapSet;
use rayon::prelude::*;

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
    let nearest = |order: &mut dyn Iterator<Item = usize>| {
        let mut last = None;
        let mut out = vec![None; disparity.len()];
        for x in order {
            if flags[x] & flag::INVALID == 0 {
                last = Some(disparity[x]);
            }
            out[x] = last;
        }
        out
    };
    let left = nearest(&mut (0..disparity.len()));
    let right = nearest(&mut (0..disparity.len()).rev());
    left.into_iter()
        .zip(right)
        .map(|sides| match sides {
            (Some(l), Some(r)) => farther(l, r),
            (l, r) => l.or(r).unwrap_or_default(),
        })
        .collect()
}
