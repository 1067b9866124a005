//! Disparities between the labels: see [`crate::backend::Stage::SubPixel`].

use super::features::NEAR;
use super::finest::Finest;
use super::units::Units;
use super::volumes::Volumes;
use crate::maps::FRACTION;
use crate::plan::Plan;
use rayon::prelude::*;
use std::ops::Range;

/// Rows that a thread takes at a time: the costs of the rows around them are computed once more for the next ones.
const ROWS: usize = 8;

pub(super) fn run<U: Units>(v: &mut Volumes<U>) {
    rows(v, 0..v.plan.levels[0].height);
}

/// The disparities of these rows.
pub(super) fn rows<U: Units>(v: &mut Volumes<U>, rows: Range<usize>) {
    let Volumes { plan, features, fine_cost, maps, .. } = v;
    let level = &plan.levels[0];
    let Finest { optima, raw, disparity, .. } = maps;
    let label = |x: usize, y: usize| optima[(x, y)].label;
    let raw = raw.rows_mut(rows.clone()).par_chunks_mut(level.width * ROWS);
    let disparity = disparity.rows_mut(rows.clone()).par_chunks_mut(level.width * ROWS);
    raw.zip(disparity).enumerate().for_each_init(Vec::new, |near, (i, (raw, disparity))| {
        let first = rows.start + i * ROWS;
        let end = first + raw.len() / level.width;
        let (above, below) = (first.saturating_sub(1), (end + 1).min(level.height));
        let with_offset = plan.method.refinement.sub_pixel;
        let stored = plan.holds_all_rows();
        if with_offset && !stored {
            near.resize((below - above) * level.width, [0; NEAR]);
            for (y, near) in (above..below).zip(near.chunks_exact_mut(level.width)) {
                features.costs_near(plan, y, optima.row(y), near);
            }
        }
        // Three costs of the pixel at (x, y), from label `from` on, which is at most two below its own.
        let costs = |x: usize, y: usize, from: usize| -> &[u8] {
            if stored {
                &fine_cost[(y * level.width + x) * level.stride + from..][..3]
            } else {
                &near[(y - above) * level.width + x][from + 2 - usize::from(label(x, y))..][..3]
            }
        };
        for (y, row) in (first..end).zip(raw.chunks_exact_mut(level.width)) {
            for (x, raw) in row.iter_mut().enumerate() {
                *raw = FRACTION * (plan.range.min + i32::from(label(x, y)));
                if with_offset {
                    *raw += offset(plan, costs, label, (x, y));
                }
            }
        }
        disparity.copy_from_slice(raw);
    });
}

/// How far the disparity of the pixel at (x, y) is above its label; `costs` are those of a pixel at three labels.
fn offset<'a>(
    plan: &Plan,
    costs: impl Fn(usize, usize, usize) -> &'a [u8],
    label_at: impl Fn(usize, usize) -> u16,
    (x, y): (usize, usize),
) -> i32 {
    let level = &plan.levels[0];
    let label = label_at(x, y);
    let first = usize::from(label).wrapping_sub(1);
    if label == 0 || first + 2 >= level.labels {
        return 0;
    }
    let mut sums = [0i32; 3];
    for ny in y.saturating_sub(1)..(y + 2).min(level.height) {
        for nx in x.saturating_sub(1)..(x + 2).min(level.width) {
            if label_at(nx, ny).abs_diff(label) <= 1 {
                for (sum, &c) in sums.iter_mut().zip(costs(nx, ny, first)) {
                    *sum += i32::from(c);
                }
            }
        }
    }
    let [below, at, above] = sums;
    let slope = below.max(above) - at;
    if slope <= 0 {
        return 0;
    }
    (FRACTION * (below - above) + slope).div_euclid(2 * slope).clamp(-FRACTION / 2, FRACTION / 2)
}
