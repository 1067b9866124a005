//! The optimum of the beliefs: see [`crate::backend::Stage::Estimate`], [`crate::backend::Stage::RightView`] and
//! [`crate::backend::Stage::Change`].

use super::{Finest, Peak};
use crate::backend::NO_LABEL;
use crate::plan::Plan;
use rayon::prelude::*;

pub(super) fn run(plan: &Plan, belief: &[u16], maps: &mut Finest) {
    let level = &plan.levels[0];
    let peaks = maps.peaks.data_mut().par_iter_mut();
    peaks.zip(belief.par_chunks_exact(level.stride)).for_each(|(peak, belief)| {
        *peak = peak_of(&belief[..level.labels]);
    });
}

pub(super) fn right_view(plan: &Plan, belief: &[u16], maps: &mut Finest) {
    let level = &plan.levels[0];
    let (width, labels, stride) = (level.width, level.labels, level.stride);
    let rows =
        maps.right.data_mut().par_chunks_mut(width).zip(maps.right_best.data_mut().par_chunks_mut(width));
    rows.zip(belief.par_chunks(width * stride)).for_each(|((right, smallest), row)| {
        smallest.fill(u16::MAX);
        right.fill(NO_LABEL);
        for (x, belief) in row.chunks_exact(stride).enumerate().take(plan.core.end).skip(plan.core.start) {
            // Label j of left pixel x is seen at right pixel x - min - j. For one right pixel x falls as j does, so
            // labels arrive in ascending order and the first of equals stays.
            let seen = x as i64 - i64::from(level.min);
            for (j, &b) in belief[..labels].iter().enumerate() {
                let xr = seen - j as i64;
                if xr >= 0
                    && xr < width as i64
                    && (right[xr as usize] == NO_LABEL || b < smallest[xr as usize])
                {
                    (right[xr as usize], smallest[xr as usize]) = (j as u16, b);
                }
            }
        }
    });
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
