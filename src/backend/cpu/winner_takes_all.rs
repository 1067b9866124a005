//! The optimum of the beliefs: see [`crate::backend::Stage::WinnerTakesAll`], [`crate::backend::Stage::RightView`] and
//! [`crate::backend::Stage::Change`].

use super::units::{Units, smallest};
use super::{Finest, Optimum};
use crate::plan::{LABEL_BLOCK, LevelPlan, Plan};
use rayon::prelude::*;

pub(super) fn run<U: Units>(plan: &Plan, belief: &[U], maps: &mut Finest) {
    let level = &plan.levels[0];
    let optima = maps.optima.data_mut().par_chunks_mut(level.width);
    optima
        .zip(belief.par_chunks_exact(level.width * level.stride))
        .for_each(|(optima, beliefs)| peak_row(level, beliefs, optima));
}

#[pulp::with_simd(peak_row = pulp::Arch::new())]
#[inline(always)]
fn peak_row_on<'a, S: pulp::Simd, U: Units>(
    _: S,
    level: &'a LevelPlan,
    beliefs: &'a [U],
    optima: &'a mut [Optimum],
) {
    for (peak, belief) in optima.iter_mut().zip(beliefs.chunks_exact(level.stride)) {
        *peak = peak_of(&belief[..level.labels]);
    }
}

pub(super) fn right_view<U: Units>(plan: &Plan, belief: &[U], maps: &mut Finest) {
    let level = &plan.levels[0];
    let (width, labels, stride) = (level.width, level.labels, level.stride);
    let names: Vec<u32> = (0..labels as u32).collect();
    let rows =
        maps.right.data_mut().par_chunks_mut(width).zip(maps.right_best.data_mut().par_chunks_mut(width));
    rows.zip(belief.par_chunks(width * stride)).for_each_init(
        // By the right pixel's place from the right, so that ascending labels are side by side: belief and label of the best
        // so far, or as much as [`crate::backend::NO_LABEL`] says in both.
        || vec![u32::MAX; width],
        |found, ((right, best), row)| {
            found.fill(u32::MAX);
            right_row(plan, &names, row, found);
            for ((right, best), &found) in right.iter_mut().zip(best).zip(found.iter().rev()) {
                (*right, *best) = (found as u16, (found >> 16) as u16);
            }
        },
    );
}

#[pulp::with_simd(right_row = pulp::Arch::new())]
#[inline(always)]
fn right_row_on<'a, S: pulp::Simd, U: Units>(
    _: S,
    plan: &'a Plan,
    names: &'a [u32],
    row: &'a [U],
    found: &'a mut [u32],
) {
    let level = &plan.levels[0];
    let (width, labels) = (level.width, level.labels);
    for (x, belief) in row.chunks_exact(level.stride).enumerate().take(plan.core.end).skip(plan.core.start) {
        // Label j of left pixel x is seen at right pixel x - min - j.
        let place = (width - 1 - x) as i64 + i64::from(level.min);
        let first = (-place).clamp(0, labels as i64) as usize;
        let end = (width as i64 - place).clamp(first as i64, labels as i64) as usize;
        if first >= end {
            continue;
        }
        let seen = (place + first as i64) as usize..(place + end as i64) as usize;
        let beliefs = belief[first..end].iter().zip(&names[first..end]);
        for (found, (&b, &label)) in found[seen].iter_mut().zip(beliefs) {
            // The smallest belief, and of those the lowest label.
            let b: u32 = b.into();
            *found = (*found).min(b << 16 | label);
        }
    }
}

#[inline(always)]
fn peak_of<U: Units>(belief: &[U]) -> Optimum {
    let (label, best) = optimum(belief);
    let below = &belief[..label.saturating_sub(1)];
    let above = belief.get(label + 2..).unwrap_or_default();
    let runner_up = if below.is_empty() && above.is_empty() {
        u16::MAX
    } else {
        smallest(below).min(smallest(above)).into()
    };
    Optimum { label: label as u16, best: best.into(), runner_up }
}

/// Index and value of the smallest belief, the lowest index on ties.
#[inline(always)]
fn optimum<U: Units>(belief: &[U]) -> (usize, U) {
    let best = smallest(belief);
    // By blocks: whether one holds it is a vector's question.
    let holds = |block: &[U]| smallest(block) == best;
    let block = belief.chunks(LABEL_BLOCK).position(holds);
    let start = block.unwrap_or(0) * LABEL_BLOCK;
    (start + belief[start..].iter().position(|&b| b == best).unwrap_or(0), best)
}

pub(super) fn change<U: Units>(plan: &Plan, belief: &[U], labels: &mut [u16]) -> u64 {
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
