//! Sub-pixel disparities: see [`crate::backend::Stage::SubPixel`].
//!
//! Neighbours count if their label is at most [`NEAR`] away, so their costs are needed only up to [`FAR`]
//! labels from their own label. The costs at each distance from it form a plane. The lanes of vectors are
//! neighbouring pixels; the difference of labels selects the plane of a neighbour.

use crate::backend::cpu::features::FAR;
use crate::backend::cpu::units::{Units, block, each_lane};
use crate::backend::cpu::volumes::Volumes;
use crate::maps::FRACTION;
use crate::plan::LevelPlan;
use crate::stage::NO_LABEL;
use crate::stage::{MapSet, Optimum};
use crate::threads::prelude::*;
use std::ops::Range;

/// Computes the disparities of `rows`.
pub(super) fn rows<U: Units>(v: &mut Volumes<U>, rows: Range<usize>) {
    let Volumes { plan, features, fine_cost, maps, .. } = v;
    let level = &plan.levels[0];
    let MapSet { optima, raw, disparity, .. } = maps;
    let cells = BAND * level.width;
    let last = level.labels as u16 - 1;
    let raw = raw.rows_mut(rows.clone()).par_chunks_mut(cells);
    let bands = raw.zip(disparity.rows_mut(rows.clone()).par_chunks_mut(cells));
    bands.enumerate().for_each_init(
        Scratch::default,
        |Scratch { near, words, sums }, (band, (raw, disparity))| {
            let first = rows.start + band * BAND;
            if plan.method.refinement.sub_pixel {
                words.resize(level.width, 0);
                near.resize_with(raw.len() / level.width + 2, Near::default);
                for (near, y) in near.iter_mut().zip(first..) {
                    near.clear(level.width);
                    if let Some(y) = y.checked_sub(1).filter(|&y| y < level.height) {
                        if plan.stores_costs() {
                            collect(level, fine_cost, y, optima.row(y), words);
                        } else {
                            features.costs_near(plan, y, optima.row(y), words);
                        }
                        near.fill(optima.row(y), words);
                    }
                }
            }
            sums.resize(level.width.div_ceil(LANES), Sums::default());
            for (y, raw) in raw.chunks_exact_mut(level.width).enumerate() {
                if plan.method.refinement.sub_pixel {
                    sum_row([&near[y], &near[y + 1], &near[y + 2]], sums);
                }
                let optima = optima.row(first + y).chunks(LANES);
                for ((raw, optima), sums) in raw.chunks_mut(LANES).zip(optima).zip(&*sums) {
                    for (i, (raw, &Optimum { label, .. })) in raw.iter_mut().zip(optima).enumerate() {
                        let inside = label > 0 && usize::from(label) + 1 < level.labels;
                        let offset = if inside { offset(sums.map(|sum| sum[i].into())) } else { 0 };
                        let label = label.min(last);
                        *raw = FRACTION * (plan.range.min + i32::from(label)) + offset;
                    }
                }
            }
            disparity.copy_from_slice(raw);
        },
    );
}

/// Number of rows that are processed together.
const BAND: usize = 8;
/// Largest horizontal distance of a neighbour.
const RADIUS: usize = 2;
/// Largest difference of the label of a neighbour.
const NEAR: u16 = 2;
// Its costs are needed one label further.
const _: () = assert!(FAR == NEAR as usize + 1);
/// Replaces [`NO_LABEL`]: it is far from every label, even if differences wrap.
const NOWHERE: u16 = 1 << 15;
/// Number of pixels whose costs are summed together, in vectors of 16 bits.
const LANES: usize = 16;

/// Sums of costs below, at and above the label, for [`LANES`] pixels; 0 without sub-pixel disparities.
type Sums = [[u16; LANES]; 3];

#[derive(Default)]
struct Scratch {
    near: Vec<Near>,
    words: Vec<u64>,
    sums: Vec<Sums>,
}

/// The costs around the labels of a row, with pixels without a label at either end.
#[derive(Default)]
struct Near {
    labels: Vec<u16>,
    /// From [`FAR`] labels below the label to [`FAR`] above. Those outside the range are never used.
    costs: [Vec<u16>; 2 * FAR + 1],
}

impl Near {
    /// Resets all pixels to "no label".
    fn clear(&mut self, width: usize) {
        let cells = width.next_multiple_of(LANES) + 2 * RADIUS;
        self.labels.clear();
        self.labels.resize(cells, NOWHERE);
        self.costs.iter_mut().for_each(|costs| costs.resize(cells, 0));
    }

    /// Loads the labels of a row, and a word of costs for each.
    fn fill(&mut self, optima: &[Optimum], words: &[u64]) {
        for (to, &Optimum { label, .. }) in self.labels[RADIUS..].iter_mut().zip(optima) {
            *to = if label == NO_LABEL { NOWHERE } else { label };
        }
        for (k, costs) in self.costs.iter_mut().enumerate() {
            for (to, word) in costs[RADIUS..].iter_mut().zip(words) {
                *to = (word >> (8 * k)) as u16 & 0xff;
            }
        }
    }
}

/// Collects the costs around the labels of row `y`, one byte each, from a whole volume.
fn collect(level: &LevelPlan, cost: &[u8], y: usize, optima: &[Optimum], words: &mut [u64]) {
    let cells = (y * level.width * level.stride..).step_by(level.stride);
    for ((&Optimum { label, .. }, start), word) in optima.iter().zip(cells).zip(words) {
        if label == NO_LABEL {
            continue;
        }
        let first = (start + usize::from(label)).wrapping_sub(FAR);
        let bytes = cost.get(first..).and_then(|cells| cells.first_chunk());
        // At the ends of the volume, read byte by byte.
        let one = |k: usize| cost.get(first.wrapping_add(k)).copied().unwrap_or(0);
        *word = u64::from_le_bytes(bytes.copied().unwrap_or_else(|| std::array::from_fn(one)));
    }
}

/// The sums of a row from its own costs and those of the two adjacent rows.
#[pulp::with_simd(sum_row = crate::vectors::widest())]
#[inline(always)]
fn sum_row_on<'a, S: pulp::Simd>(_: S, near: [&'a Near; 3], sums: &'a mut [Sums]) {
    for (x, sums) in (0..).step_by(LANES).zip(sums) {
        let centres: &[u16; LANES] = block(&near[1].labels, x + RADIUS);
        let mut all = Sums::default();
        for Near { labels, costs } in near {
            for column in x..=x + 2 * RADIUS {
                let labels: &[u16; LANES] = block(labels, column);
                let costs: [&[u16; LANES]; 2 * FAR + 1] = costs.each_ref().map(|costs| block(costs, column));
                // The label of the centre minus that of the neighbour, plus NEAR.
                let above: [u16; LANES] =
                    each_lane(|i| centres[i].wrapping_sub(labels[i]).wrapping_add(NEAR));
                for apart in 0..=2 * usize::from(NEAR) {
                    let counts: [u16; LANES] =
                        each_lane(|i| u16::from(above[i] == apart as u16).wrapping_neg());
                    for (k, sum) in all.iter_mut().enumerate() {
                        *sum = each_lane(|i| sum[i] + (costs[apart + k][i] & counts[i]));
                    }
                }
            }
        }
        *sums = all;
    }
}

/// The offset of the disparity from the label.
#[inline(always)]
fn offset([below, at, above]: [i32; 3]) -> i32 {
    let slope = below.max(above) - at;
    if slope <= 0 {
        return 0;
    }
    (FRACTION * (below - above) + slope).div_euclid(2 * slope).clamp(-FRACTION, FRACTION)
}
