//! Cost of a level from the next finer one: see [`crate::backend::Stage::Pyramid`].

use super::units::Units;
use super::volumes::Volumes;
use crate::plan::Plan;
use rayon::prelude::*;

const WEIGHTS: [u32; 5] = [1, 4, 6, 4, 1];

/// A stored cost.
pub(super) trait StoredCost: Copy + Default + Ord + Send + Sync {
    /// A type for sums over a 5 x 5 binomial window, of up to 256 times 254 or of 16-bit values.
    type Sum: Copy + Default + Send + Sync;

    /// The largest value that can be stored.
    const MOST: Self;

    /// The cost in 1/256 cost units.
    fn fraction(self) -> u16;

    /// `sum` plus `weight` times this cost.
    fn add(self, sum: Self::Sum, weight: u32) -> Self::Sum;

    /// `sum` plus `weight` times `other`.
    fn add_sums(sum: Self::Sum, weight: u32, other: Self::Sum) -> Self::Sum;

    /// The mean of a sum over the whole window, in 1/256 cost units, to the nearest.
    fn mean(sum: Self::Sum) -> u16;
}

impl StoredCost for u8 {
    type Sum = u16;

    const MOST: Self = Self::MAX;

    #[inline(always)]
    fn fraction(self) -> u16 {
        u16::from(self) << crate::plan::COST_FRACTION_BITS
    }

    #[inline(always)]
    fn add(self, sum: u16, weight: u32) -> u16 {
        sum.wrapping_add(u16::from(self).wrapping_mul(weight as u16))
    }

    #[inline(always)]
    fn add_sums(sum: u16, weight: u32, other: u16) -> u16 {
        sum.wrapping_add(other.wrapping_mul(weight as u16))
    }

    /// The weights sum to 256, so the sum is already in 1/256 units.
    #[inline(always)]
    fn mean(sum: u16) -> u16 {
        sum
    }
}

impl StoredCost for u16 {
    type Sum = u32;

    const MOST: Self = Self::MAX;

    #[inline(always)]
    fn fraction(self) -> u16 {
        self
    }

    #[inline(always)]
    fn add(self, sum: u32, weight: u32) -> u32 {
        sum + u32::from(self) * weight
    }

    #[inline(always)]
    fn add_sums(sum: u32, weight: u32, other: u32) -> u32 {
        sum + other * weight
    }

    #[inline(always)]
    fn mean(sum: u32) -> u16 {
        ((sum + 128) >> 8) as u16
    }
}

pub(super) fn run<U: Units>(v: &mut Volumes<U>, level: usize) {
    let (finer, coarser) = v.levels.split_at_mut(level);
    let out = &mut coarser[0].cost;
    if level == 1 {
        reduce(&v.plan, level, &v.fine_cost, out);
    } else {
        reduce(&v.plan, level, &finer[level - 1].cost, out);
    }
}

fn reduce<C: StoredCost>(plan: &Plan, level: usize, fine: &[C], out: &mut [u16]) {
    let (fl, cl) = (&plan.levels[level - 1], &plan.levels[level]);
    let offset = plan.label_offset(level);
    let minimum = plan.minimum_over_d();
    let row_cells = fl.width * fl.stride;
    out.par_chunks_mut(cl.width * cl.stride).enumerate().for_each_init(
        // The five fine rows reduced over y, then one pixel reduced over x as well, with a margin of
        // two labels.
        || {
            let sums = |n| vec![C::Sum::default(); n];
            (sums(row_cells), sums(fl.stride), vec![0u16; 2 * cl.stride + 5])
        },
        |(column, sums, smooth), (y, row)| {
            let fine_row = |j: usize| {
                let fy = (2 * y + j).saturating_sub(2).min(fl.height - 1);
                &fine[fy * row_cells..][..row_cells]
            };
            let rows = [0, 1, 2, 3, 4].map(fine_row);
            add_all(rows, |sum, weight, cost| cost.add(sum, weight), column);
            for (x, costs) in row.chunks_exact_mut(cl.stride).enumerate() {
                let columns = [0, 1, 2, 3, 4].map(|i: usize| {
                    let fx = (2 * x + i).saturating_sub(2).min(fl.width - 1);
                    &column[fx * fl.stride..][..fl.labels]
                });
                let (before, inside) = smooth.split_at_mut((2 - offset) as usize);
                let (inside, after) = inside.split_at_mut(fl.labels);
                add_all(columns, C::add_sums, &mut sums[..fl.labels]);
                inside.iter_mut().zip(sums.iter()).for_each(|(mean, &sum)| *mean = C::mean(sum));
                before.fill(inside[0]);
                after.fill(inside[fl.labels - 1]);
                reduce_labels(smooth, minimum, &mut costs[..cl.labels]);
                costs[cl.labels..].fill(u16::MAX);
            }
        },
    );
}

/// The binomial sum of five rows; `add` adds a weight times a value to a sum.
#[inline(always)]
fn add_all<T: Copy, S: Copy + Default>(rows: [&[T]; 5], add: impl Fn(S, u32, T) -> S, out: &mut [S]) {
    let [a, b, c, d, e] = rows.map(|row| &row[..out.len()]);
    for (i, out) in out.iter_mut().enumerate() {
        let values = [a[i], b[i], c[i], d[i], e[i]];
        *out = values.into_iter().zip(WEIGHTS).fold(S::default(), |sum, (v, w)| add(sum, w, v));
    }
}

/// The cost of each coarse label from the smoothed costs of the fine labels: the five around coarse label z
/// start at 2 z.
#[inline(always)]
fn reduce_labels(fine: &[u16], minimum: bool, out: &mut [u16]) {
    let pairs = || fine.chunks_exact(2);
    if minimum {
        // Clamping repeats one of the three labels, unless the centre is outside; then it repeats the one
        // inside.
        for (out, (first, second)) in out.iter_mut().zip(pairs().zip(pairs().skip(1))) {
            *out = first[1].min(second[0]).min(second[1]);
        }
    } else {
        let triples = pairs().zip(pairs().skip(1)).zip(pairs().skip(2));
        for (out, ((first, second), third)) in out.iter_mut().zip(triples) {
            let [a, b, c, d, e] = [first[0], first[1], second[0], second[1], third[0]].map(u32::from);
            *out = ((a + 4 * b + 6 * c + 4 * d + e + 8) >> 4) as u16;
        }
    }
}
