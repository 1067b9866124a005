//! Disparities between the labels: see [`crate::backend::Stage::SubPixel`].

use super::finest::Finest;
use super::units::Units;
use super::volumes::Volumes;
use crate::maps::FRACTION;
use crate::plan::Plan;
use rayon::prelude::*;

pub(super) fn run<U: Units>(v: &mut Volumes<U>) {
    let Volumes { plan, fine_cost: cost, maps, .. } = v;
    let width = plan.levels[0].width;
    let Finest { optima, raw, disparity, .. } = maps;
    raw.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for (x, raw) in row.iter_mut().enumerate() {
            let label = |x: usize, y: usize| optima[(x, y)].label;
            *raw = FRACTION * (plan.range.min + i32::from(label(x, y)));
            if plan.method.refinement.sub_pixel {
                *raw += offset(plan, cost, label, (x, y));
            }
        }
    });
    disparity.data_mut().copy_from_slice(raw.data());
}

/// How far the disparity of the pixel at (x, y) is above its label.
fn offset(plan: &Plan, cost: &[u8], label_at: impl Fn(usize, usize) -> u16, (x, y): (usize, usize)) -> i32 {
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
                let costs = &cost[(ny * level.width + nx) * level.stride + first..][..3];
                for (sum, &c) in sums.iter_mut().zip(costs) {
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
