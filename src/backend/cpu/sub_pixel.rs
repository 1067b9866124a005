//! Disparities between the labels: see [`crate::backend::Stage::SubPixel`].
//!
//! A neighbour counts where its label is at most one away, so the sums need no more of its costs than those up to two labels from its own.
//! These five are packed into a word of 12-bit fields. Shifted to the label of the centre, the words of all neighbours add up to the
//! three sums at once.

use super::features::Features;
use super::finest::{Finest, Optimum};
use super::units::Units;
use super::volumes::Volumes;
use crate::backend::volume::NO_LABEL;
use crate::maps::FRACTION;
use crate::plan::{LevelPlan, Plan};
use rayon::prelude::*;
use std::ops::Range;

pub(super) fn run<U: Units>(v: &mut Volumes<U>) {
    rows(v, 0..v.plan.levels[0].height);
}

/// The disparities of these rows.
pub(super) fn rows<U: Units>(v: &mut Volumes<U>, rows: Range<usize>) {
    let Volumes { plan, features, fine_cost, maps, .. } = v;
    let level = &plan.levels[0];
    let Finest { optima, raw, disparity, .. } = maps;
    let cells = BAND * level.width;
    let raw = raw.rows_mut(rows.clone()).par_chunks_mut(cells);
    let bands = raw.zip(disparity.rows_mut(rows.clone()).par_chunks_mut(cells));
    bands.enumerate().for_each_init(Scratch::default, |Scratch { near, sums }, (band, (raw, disparity))| {
        let first = rows.start + band * BAND;
        if plan.method.refinement.sub_pixel {
            near.resize_with(raw.len() / level.width + 2, Near::default);
            for (near, y) in near.iter_mut().zip(first..) {
                near.clear(level.width);
                if let Some(y) = y.checked_sub(1).filter(|&y| y < level.height) {
                    if plan.holds_all_rows() {
                        near.collect(level, fine_cost, y, optima.row(y));
                    } else {
                        near.compute(plan, features, y, optima.row(y));
                    }
                }
            }
        }
        sums.resize(level.width, 0);
        for (y, raw) in raw.chunks_exact_mut(level.width).enumerate() {
            if plan.method.refinement.sub_pixel {
                sum_row([&near[y], &near[y + 1], &near[y + 2]], sums);
            }
            for ((raw, optimum), &sums) in raw.iter_mut().zip(optima.row(first + y)).zip(&*sums) {
                let label = optimum.label;
                let inside = label > 0 && usize::from(label) + 1 < level.labels;
                *raw = FRACTION * (plan.range.min + i32::from(label)) + if inside { offset(sums) } else { 0 };
            }
        }
        disparity.copy_from_slice(raw);
    });
}

/// Number of rows that are processed together.
const BAND: usize = 8;
/// Bits of a sum of nine costs.
const SUM_BITS: u32 = 12;

#[derive(Default)]
struct Scratch {
    near: Vec<Near>,
    /// Of a row; 0 where nothing is placed between the labels.
    sums: Vec<u64>,
}

/// The costs around the labels of a row, with a pixel without a label at either end.
#[derive(Default)]
struct Near {
    /// [`SUM_BITS`] times the label, far from all others where there is none.
    labels: Vec<i64>,
    /// From two labels below the label to two above it, [`SUM_BITS`] each. Those outside the range are never used.
    costs: Vec<u64>,
}

impl Near {
    /// The same as without any labels.
    fn clear(&mut self, width: usize) {
        self.labels.clear();
        self.costs.clear();
        self.labels.resize(width + 2, i64::MIN / 4);
        self.costs.resize(width + 2, 0);
    }

    fn place(&mut self, optima: &[Optimum]) {
        for (to, &Optimum { label, .. }) in self.labels[1..].iter_mut().zip(optima) {
            if label != NO_LABEL {
                *to = i64::from(SUM_BITS) * i64::from(label);
            }
        }
    }

    /// Computes the costs of row `y`.
    fn compute(&mut self, plan: &Plan, features: &Features, y: usize, optima: &[Optimum]) {
        self.place(optima);
        features.costs_near(plan, y, optima, &mut self.costs[1..]);
        spread(&mut self.costs);
    }

    /// Collects them from those of all pixels.
    fn collect(&mut self, level: &LevelPlan, cost: &[u8], y: usize, optima: &[Optimum]) {
        self.place(optima);
        let cells = (y * level.width * level.stride..).step_by(level.stride);
        for ((&Optimum { label, .. }, start), costs) in optima.iter().zip(cells).zip(&mut self.costs[1..]) {
            if label == NO_LABEL {
                continue;
            }
            let first = (start + usize::from(label)).wrapping_sub(2);
            let bytes = cost.get(first..).and_then(|cells| cells.first_chunk());
            // At the ends of the volume, one by one.
            let one = |k: usize| cost.get(first.wrapping_add(k)).copied().unwrap_or(0);
            *costs = u64::from_le_bytes(bytes.copied().unwrap_or_else(|| std::array::from_fn(one)));
        }
        spread(&mut self.costs);
    }
}

/// The first five bytes of each word, apart by [`SUM_BITS`].
fn spread(words: &mut [u64]) {
    for word in words {
        let byte = |k: u32| (*word >> (u8::BITS * k) & 0xff) << (SUM_BITS * k);
        *word = byte(0) | byte(1) | byte(2) | byte(3) | byte(4);
    }
}

/// The sums of a row from its own costs and those of the rows around it: of the costs at the label below, at the label and above.
#[pulp::with_simd(sum_row = pulp::Arch::new())]
#[inline(always)]
fn sum_row_on<'a, S: pulp::Simd>(_: S, near: [&'a Near; 3], sums: &'a mut [u64]) {
    let width = sums.len();
    sums.fill(0);
    let centres = &near[1].labels[1..=width];
    for Near { labels, costs } in near {
        for column in 0..3 {
            let there = labels[column..][..width].iter().zip(&costs[column..][..width]);
            for ((sum, centre), (label, costs)) in sums.iter_mut().zip(centres).zip(there) {
                let shift = centre + i64::from(SUM_BITS) - label;
                let counts = 0 <= shift && shift <= 2 * i64::from(SUM_BITS);
                *sum = sum.wrapping_add(costs.wrapping_shr(shift as u32) & u64::from(counts).wrapping_neg());
            }
        }
    }
}

/// How far the disparity is above the label.
#[inline(always)]
fn offset(sums: u64) -> i32 {
    let [below, at, above] = [0, 1, 2].map(|k| (sums >> (SUM_BITS * k)) as i32 & ((1 << SUM_BITS) - 1));
    let slope = below.max(above) - at;
    if slope <= 0 {
        return 0;
    }
    (FRACTION * (below - above) + slope).div_euclid(2 * slope).clamp(-FRACTION / 2, FRACTION / 2)
}
