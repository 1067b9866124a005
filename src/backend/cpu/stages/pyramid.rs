//! Cost of a level from the next finer one: see [`crate::backend::Stage::Pyramid`].

use crate::backend::cpu::units::Units;
use crate::backend::cpu::volumes::Volumes;
use crate::plan::{LevelPlan, Plan};
use crate::threads::prelude::*;

const WEIGHTS: [u32; 5] = [1, 4, 6, 4, 1];

/// A stored cost.
pub(super) trait StoredCost: Copy + Default + Ord + Send + Sync {
    /// A type for sums over a 5 x 5 binomial window of costs: 256 times up to 254, or of 16-bit values.
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

/// Coarse rows per task if fine costs are not stored. Tasks recompute the fine rows that they share.
const ROWS: usize = 16;

pub(super) fn run<U: Units>(v: &mut Volumes<U>, level: usize) {
    let (plan, features) = (&v.plan, &v.features);
    let (finer, coarser) = v.levels.split_at_mut(level);
    let out = &mut coarser[0].cost;
    if level > 1 {
        reduce(plan, level, &finer[level - 1].cost, out);
    } else if plan.stores_costs() {
        reduce(plan, level, &v.fine_cost, out);
    } else {
        let (fine, coarse) = (&plan.levels[0], &plan.levels[1]);
        let row_cells = coarse.width * coarse.stride;
        out.par_chunks_mut(ROWS * row_cells).enumerate().for_each_init(
            || (Scratch::new(fine, coarse), Held::new(fine)),
            |(scratch, held), (i, rows)| {
                for (y, row) in (i * ROWS..).zip(rows.chunks_exact_mut(row_cells)) {
                    let rows = held.rows(around(y, fine), |y, costs| features.costs(plan, y, costs));
                    reduce_row(plan, level, rows, scratch, row);
                }
            },
        );
    }
}

fn reduce<C: StoredCost>(plan: &Plan, level: usize, fine: &[C], out: &mut [u16]) {
    let (fl, cl) = (&plan.levels[level - 1], &plan.levels[level]);
    let row_cells = fl.width * fl.stride;
    out.par_chunks_mut(cl.width * cl.stride).enumerate().for_each_init(
        || Scratch::new(fl, cl),
        |scratch, (y, row)| {
            let rows = around(y, fl).map(|fy| &fine[fy * row_cells..][..row_cells]);
            reduce_row(plan, level, rows, scratch, row);
        },
    );
}

/// The fine rows from which a coarse row is computed.
fn around(y: usize, fine: &LevelPlan) -> [usize; 5] {
    [0, 1, 2, 3, 4].map(|j: usize| (2 * y + j).saturating_sub(2).min(fine.height - 1))
}

/// The last few rows of costs.
struct Held {
    row_cells: usize,
    costs: Vec<u8>,
    rows: [Option<usize>; 5],
}

impl Held {
    fn new(fine: &LevelPlan) -> Self {
        let row_cells = fine.width * fine.stride;
        Self { row_cells, costs: vec![0; 5 * row_cells], rows: [None; 5] }
    }

    /// The costs of `rows`, no two more than four apart; `compute` computes those that are missing.
    fn rows(&mut self, rows: [usize; 5], compute: impl Fn(usize, &mut [u8])) -> [&[u8]; 5] {
        for y in rows {
            if self.rows[y % 5] != Some(y) {
                compute(y, &mut self.costs[y % 5 * self.row_cells..][..self.row_cells]);
                self.rows[y % 5] = Some(y);
            }
        }
        rows.map(|y| &self.costs[y % 5 * self.row_cells..][..self.row_cells])
    }
}

/// Working memory of a thread.
struct Scratch<S> {
    /// The sum of the five fine rows over y.
    columns: Vec<S>,
    /// The sum for one pixel over x and y.
    sums: Vec<S>,
    /// Its mean, with a margin of two labels.
    smooth: Vec<u16>,
}

impl<S: Copy + Default> Scratch<S> {
    fn new(fine: &LevelPlan, coarse: &LevelPlan) -> Self {
        let sums = |n| vec![S::default(); n];
        Self {
            columns: sums(fine.width * fine.stride),
            sums: sums(fine.stride),
            smooth: vec![0; 2 * coarse.stride + 5],
        }
    }
}

/// A row of a level, from five rows of the next finer one.
#[pulp::with_simd(reduce_row = crate::vectors::widest())]
#[inline(always)]
fn reduce_row_on<'a, D: pulp::Simd, C: StoredCost>(
    _: D,
    plan: &'a Plan,
    level: usize,
    rows: [&'a [C]; 5],
    scratch: &'a mut Scratch<C::Sum>,
    out: &'a mut [u16],
) {
    let (fl, cl) = (&plan.levels[level - 1], &plan.levels[level]);
    let (offset, minimum) = (plan.label_offset(level), plan.minimum_over_d());
    let Scratch { columns, sums, smooth } = scratch;
    add_all(rows, |sum, weight, cost| cost.add(sum, weight), columns);
    for (x, costs) in out.chunks_exact_mut(cl.stride).enumerate() {
        let columns = [0, 1, 2, 3, 4].map(|i: usize| {
            let fx = (2 * x + i).saturating_sub(2).min(fl.width - 1);
            &columns[fx * fl.stride..][..fl.labels]
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

/// The cost of each coarse label from the smoothed costs of the fine labels; the five for coarse label z
/// start at 2 z.
#[inline(always)]
fn reduce_labels(fine: &[u16], minimum: bool, out: &mut [u16]) {
    let pairs = || fine.chunks_exact(2);
    if minimum {
        // Clamping repeats one of the three labels; if the centre is outside, it repeats the one inside.
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
