//! The optimum of the beliefs: see [`crate::backend::Backend::estimate`] and [`crate::backend::Backend::change`].

use crate::backend::{Estimate, NO_LABEL, Peak};
use crate::image::Plane;
use crate::plan::Plan;
use rayon::prelude::*;

pub(super) fn run(plan: &Plan, belief: &[u16]) -> Estimate {
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
    Estimate { peaks: Plane::new(width, height, peaks), right: Plane::new(width, height, right) }
}

fn peak_of(belief: &[u16]) -> Peak {
    let (label, best) = optimum(belief);
    let at = |j: Option<usize>| j.and_then(|j| belief.get(j)).copied().unwrap_or(u16::MAX);
    let below = &belief[..label.saturating_sub(1)];
    let above = belief.get(label + 2..).unwrap_or_default();
    Peak {
        label: label as u16,
        best,
        lower: at(label.checked_sub(1)),
        upper: at(Some(label + 1)),
        rival: below.iter().chain(above).copied().min().unwrap_or(u16::MAX),
    }
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
