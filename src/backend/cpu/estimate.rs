//! The optimum of the beliefs: see [`crate::backend::Backend::estimate`] and [`crate::backend::Backend::change`].

use crate::backend::{Estimate, NO_LABEL, Peak};
use crate::image::Plane;
use crate::plan::Plan;
use crate::refine::FRACTION;
use rayon::prelude::*;

pub(super) fn run(plan: &Plan, cost: &[u8], belief: &[u16]) -> Estimate {
    let level = &plan.levels[0];
    let (width, labels, stride) = (level.width, level.labels, level.stride);
    let mut peaks = vec![Peak::default(); level.pixels()];
    let mut right = vec![NO_LABEL; level.pixels()];
    peaks.par_chunks_mut(width).zip(right.par_chunks_mut(width)).enumerate().for_each_init(
        || vec![u16::MAX; width],
        |smallest, (y, (peaks, right))| {
            smallest.fill(u16::MAX);
            let row = &belief[y * width * stride..][..width * stride];
            for (x, (peak, belief)) in peaks.iter_mut().zip(row.chunks_exact(stride)).enumerate() {
                let belief = &belief[..labels];
                *peak = peak_of(belief);
                // Label j of left pixel x is seen at right pixel x - min - j. For one right pixel x falls as j does, so
                // labels arrive in ascending order and the first of equals stays.
                let seen = x as i64 - i64::from(level.min);
                for (j, &b) in belief.iter().enumerate() {
                    let xr = seen - j as i64;
                    if xr >= 0
                        && xr < width as i64
                        && (right[xr as usize] == NO_LABEL || b < smallest[xr as usize])
                    {
                        (right[xr as usize], smallest[xr as usize]) = (j as u16, b);
                    }
                }
            }
        },
    );
    let (width, height) = plan.size();
    let peaks = Plane::new(width, height, peaks);
    let offsets = offsets(plan, cost, &peaks);
    Estimate { peaks, offsets, right: Plane::new(width, height, right) }
}

fn offsets(plan: &Plan, cost: &[u8], peaks: &Plane<Peak>) -> Plane<i16> {
    let level = &plan.levels[0];
    let (width, height) = plan.size();
    let mut offsets = vec![0; level.pixels()];
    offsets.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for (x, offset) in row.iter_mut().enumerate() {
            let label = peaks[(x, y)].label;
            let first = usize::from(label).wrapping_sub(1);
            if label == 0 || first + 2 >= level.labels {
                continue;
            }
            let mut sums = [0i32; 3];
            for ny in y.saturating_sub(1)..(y + 2).min(height) {
                for nx in x.saturating_sub(1)..(x + 2).min(width) {
                    if peaks[(nx, ny)].label.abs_diff(label) <= 1 {
                        let costs = &cost[(ny * width + nx) * level.stride + first..][..3];
                        for (sum, &c) in sums.iter_mut().zip(costs) {
                            *sum += i32::from(c);
                        }
                    }
                }
            }
            let [below, at, above] = sums;
            let slope = below.max(above) - at;
            if slope > 0 {
                let exact = (FRACTION * (below - above) + slope).div_euclid(2 * slope);
                *offset = exact.clamp(-FRACTION / 2, FRACTION / 2) as i16;
            }
        }
    });
    Plane::new(width, height, offsets)
}

fn peak_of(belief: &[u16]) -> Peak {
    let (label, best) = optimum(belief);
    let below = &belief[..label.saturating_sub(1)];
    let above = belief.get(label + 2..).unwrap_or_default();
    Peak { label: label as u16, best, rival: below.iter().chain(above).copied().min().unwrap_or(u16::MAX) }
}

/// Index and value of the smallest belief, the lowest index on ties.
fn optimum(belief: &[u16]) -> (usize, u16) {
    let best = belief.iter().copied().min().unwrap_or(0);
    (belief.iter().position(|&b| b == best).unwrap_or(0), best)
}

pub(super) fn change(plan: &Plan, belief: &[u16], labels: &mut [u16]) -> u64 {
    let level = &plan.levels[0];
    labels
        .par_chunks_mut(level.width)
        .zip(belief.par_chunks(level.width * level.stride))
        .map(|(labels, row)| {
            let mut sum = 0;
            for (label, belief) in labels.iter_mut().zip(row.chunks_exact(level.stride)) {
                let new = optimum(&belief[..level.labels]).0 as u16;
                sum += u64::from(new.abs_diff(*label)).pow(2);
                *label = new;
            }
            sum
        })
        .sum()
}
