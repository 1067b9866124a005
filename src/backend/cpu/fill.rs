//! The farther of two neighbours for what has no disparity of its own: see [`crate::backend::Stage::Fill`].

use super::Finest;
use crate::maps::flag;

pub(super) fn run(maps: &mut Finest) {
    let Finest { disparity, validity: flags, .. } = maps;
    let (width, height) = disparity.size();
    let valid_rows: Vec<usize> =
        (0..height).filter(|&y| flags.row(y).iter().any(|f| f & flag::INVALID == 0)).collect();
    if valid_rows.is_empty() {
        return;
    }
    let filled_rows: Vec<Vec<i32>> =
        valid_rows.iter().map(|&y| fill_row(disparity.row(y), flags.row(y))).collect();
    for y in 0..height {
        let nearest = (0..valid_rows.len()).min_by_key(|&i| valid_rows[i].abs_diff(y)).unwrap_or(0);
        let source = &filled_rows[nearest];
        for x in 0..width {
            let flags = &mut flags[(x, y)];
            if *flags & flag::INVALID != 0 && *flags & flag::MASKED == 0 {
                disparity[(x, y)] = source[x];
                *flags |= flag::FILLED;
            }
        }
    }
}

/// A row with at least one valid pixel, its invalid ones filled.
fn fill_row(disparity: &[i32], flags: &[u8]) -> Vec<i32> {
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
            (Some(l), Some(r)) => l.min(r),
            (l, r) => l.or(r).unwrap_or_default(),
        })
        .collect()
}
