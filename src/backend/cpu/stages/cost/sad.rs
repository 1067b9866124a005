//! The matching cost by sums of absolute differences, as running sums.
//!
//! Every thread processes bands of rows from the top. It keeps the sums over the window's rows for each
//! column and label: it adds the row that enters the window and subtracts the row that leaves. Along a row,
//! it sums the columns in the same way.

use crate::backend::cpu::units::{block, block_mut, each_lane, padding};
use crate::image::{Image, Pair, Pixel};
use crate::plan::{COST_MAX, LABEL_BLOCK, LevelPlan, Plan};
use crate::threads::prelude::*;

/// Bands per thread, so that one slow thread does not delay all others.
const BANDS: usize = 4;
/// Smallest height of a band, in windows, because each band starts by summing a whole window.
const LEAST_WINDOWS: usize = 4;

/// The costs of all pixels, \[y\]\[x\]\[label\], with padding.
pub(super) fn costs(plan: &Plan, pair: &Pair, out: &mut [u8]) {
    let level = &plan.levels[0];
    let row_cells = level.width * level.stride;
    let window = plan.method.cost.sad_window as usize;
    let rows = level.height.div_ceil(BANDS * current_num_threads()).max(LEAST_WINDOWS * window);
    let means = Means::new(plan);
    out.par_chunks_mut(rows * row_cells).enumerate().for_each(|(i, out)| {
        let (first, radius) = (i * rows, window / 2);
        let (above, end) = (first.saturating_sub(radius), first + out.len() / row_cells);
        // The window's rows of the right view, and the row that leaves it.
        let mut held = vec![Row::new(level); window + 1];
        let mut columns = Columns::new(level, window);
        let mut out = out.chunks_exact_mut(row_cells);
        for y in above..end + radius {
            let place = |y: usize| y % (window + 1);
            if y < level.height {
                held[place(y)].fill(pair.right(), y);
            }
            let views = |y: usize| Views { level, left: pair.left(), right: &held[place(y)], y };
            let enters = (y < level.height).then(|| views(y));
            let leaves = y.checked_sub(window).filter(|&y| y >= above).map(views);
            let centre = y.checked_sub(radius).filter(|&y| y >= first).map(views);
            let costs = centre.and_then(|centre| Some((centre, out.next()?)));
            step(&mut columns, enters, leaves, costs, &means);
        }
    });
}

/// Adds the row that enters the window, subtracts the one that leaves, and computes the centre row.
#[pulp::with_simd(step = crate::vectors::widest())]
#[inline(always)]
fn step_on<'a, S: pulp::Simd>(
    _: S,
    columns: &'a mut Columns,
    enters: Option<Views<'a>>,
    leaves: Option<Views<'a>>,
    mut costs: Option<(Views<'a>, &'a mut [u8])>,
    means: &'a Means,
) {
    // Block by block, so that the columns of one stay in the cache.
    for (i, sums) in columns.blocks.iter_mut().enumerate() {
        let at = i * LABEL_BLOCK;
        let inside = &mut sums[columns.margin..];
        if let Some(views) = &enters {
            views.each_difference(at, inside, Sum::plus);
        }
        if let Some(views) = &leaves {
            views.each_difference(at, inside, Sum::less);
        }
        if let Some((centre, costs)) = &mut costs {
            cost_block(centre, at, sums, columns.margin, means, costs);
        }
    }
}

/// A block of labels.
type Block<T> = [T; LABEL_BLOCK];

/// For a block of labels, the sums of differences and the numbers of pixel pairs.
#[derive(Clone, Copy, Default)]
struct Sum {
    differences: Block<u32>,
    pairs: Block<u16>,
}

impl Sum {
    #[inline(always)]
    fn plus(&self, other: &Self) -> Self {
        Self {
            differences: each_lane(|i| self.differences[i].wrapping_add(other.differences[i])),
            pairs: each_lane(|i| self.pairs[i].wrapping_add(other.pairs[i])),
        }
    }

    #[inline(always)]
    fn less(&self, other: &Self) -> Self {
        Self {
            differences: each_lane(|i| self.differences[i].wrapping_sub(other.differences[i])),
            pairs: each_lane(|i| self.pairs[i].wrapping_sub(other.pairs[i])),
        }
    }
}

/// Sums over the rows of the window.
struct Columns {
    /// Zero columns before the first column; after the last there is one less.
    margin: usize,
    /// \[block of labels\]\[column\].
    blocks: Vec<Vec<Sum>>,
}

impl Columns {
    fn new(level: &LevelPlan, window: usize) -> Self {
        let blocks = vec![vec![Sum::default(); level.width + window]; level.stride / LABEL_BLOCK];
        Self { margin: window / 2 + 1, blocks }
    }
}

/// A mirrored row of the right view, so that ascending labels are adjacent, with a margin of as many pixels
/// as labels at either end.
#[derive(Clone)]
struct Row {
    margin: usize,
    channels: [Vec<u16>; 3],
    /// All bits are set for unmasked pixels inside.
    seen: Vec<u16>,
}

impl Row {
    fn new(level: &LevelPlan) -> Self {
        let plane = || vec![0; level.width + 2 * level.stride];
        Self { margin: level.stride, channels: [plane(), plane(), plane()], seen: plane() }
    }

    fn fill(&mut self, image: &Image, y: usize) {
        let margin = self.margin;
        for (c, channel) in self.channels.iter_mut().enumerate() {
            let row = image.pixels.row(y).iter().rev();
            channel[margin..].iter_mut().zip(row).for_each(|(to, pixel)| *to = pixel[c]);
        }
        let masked = image.masked.row(y).iter().rev();
        self.seen[margin..]
            .iter_mut()
            .zip(masked)
            .for_each(|(to, &masked)| *to = u16::from(masked).wrapping_sub(1));
    }
}

/// A row of both views.
#[derive(Clone, Copy)]
struct Views<'a> {
    level: &'a LevelPlan,
    left: &'a Image,
    right: &'a Row,
    y: usize,
}

impl Views<'_> {
    /// Index of the first right pixel, by label, of left column `x`; all are in the margin if there are none.
    #[inline(always)]
    fn place(&self, x: usize) -> usize {
        let (width, margin) = (self.level.width as i64, self.right.margin as i64);
        (margin + (width - 1 - x as i64 + i64::from(self.level.min)).clamp(-margin, width)) as usize
    }

    /// Applies `change` to each column's sum, with its pixel's differences at the block of labels at `at`.
    #[inline(always)]
    fn each_difference(&self, at: usize, sums: &mut [Sum], change: impl Fn(&Sum, &Sum) -> Sum) {
        let pixels = self.left.pixels.row(self.y).iter().zip(self.left.masked.row(self.y));
        for (x, (sum, (pixel, &masked))) in sums.iter_mut().zip(pixels).enumerate() {
            if !masked {
                *sum = change(sum, &self.difference(*pixel, self.place(x) + at));
            }
        }
    }

    /// The differences of a left pixel from the right pixels from `place` on.
    #[inline(always)]
    fn difference(&self, pixel: Pixel, place: usize) -> Sum {
        let seen: Block<u16> = *block(&self.right.seen, place);
        let mut differences = Block::<u32>::default();
        for (channel, here) in self.right.channels.iter().zip(pixel) {
            let there: &Block<u16> = block(channel, place);
            let apart: Block<u16> =
                each_lane(|i| (here.saturating_sub(there[i]) | there[i].saturating_sub(here)) & seen[i]);
            differences = each_lane(|i| differences[i] + u32::from(apart[i]));
        }
        Sum { differences, pairs: each_lane(|i| seen[i] & 1) }
    }
}

/// The costs of a row at the block of labels at `at`, from the column sums.
#[inline(always)]
fn cost_block(views: &Views, at: usize, columns: &[Sum], margin: usize, means: &Means, costs: &mut [u8]) {
    let padding: Block<u8> = *block(&means.padding, at);
    let mut sum = columns[margin..2 * margin - 1].iter().fold(Sum::default(), |sum, column| sum.plus(column));
    let masked = views.left.masked.row(views.y);
    let pixels = columns.iter().zip(&columns[2 * margin - 1..]).zip(masked);
    for (x, ((leaves, enters), &masked)) in pixels.enumerate() {
        sum = sum.plus(enters).less(leaves);
        let seen: Block<u16> =
            if masked { [0; LABEL_BLOCK] } else { *block(&views.right.seen, views.place(x) + at) };
        let cost = means.of(&sum);
        let outside = u16::from(means.outside);
        *block_mut(costs, x * views.level.stride + at) =
            each_lane::<u8, LABEL_BLOCK>(|i| (cost[i] & seen[i] | outside & !seen[i]) as u8 | padding[i]);
    }
}

/// Constants to compute costs from sums.
struct Means {
    /// 2^32 / 3 n, rounded up, for each number n of pixel pairs; 0 for n = 0.
    reciprocals: Vec<u32>,
    /// Steps per 8-bit level.
    steps: u32,
    /// The cost of labels outside the right image.
    outside: u8,
    padding: Vec<u8>,
}

impl Means {
    fn new(plan: &Plan) -> Self {
        let most = u64::from(plan.method.cost.sad_window).pow(2);
        let level = &plan.levels[0];
        Self {
            reciprocals: (0..=most)
                .map(|n| if n == 0 { 0 } else { (1u64 << 32).div_ceil(3 * n) as u32 })
                .collect(),
            steps: plan.method.cost.sad_steps,
            outside: plan.outside_cost,
            padding: padding(level.labels, level.stride),
        }
    }

    /// The mean differences, in steps, at most [`COST_MAX`].
    #[inline(always)]
    fn of(&self, sum: &Sum) -> Block<u16> {
        let pairs = &sum.pairs;
        let differences: Block<u32> = each_lane(|i| sum.differences[i] * self.steps);
        // Usually all labels have the same number of pairs, and the reciprocal is constant.
        let first = pairs[0];
        if *pairs == [first; LABEL_BLOCK] {
            let reciprocal = self.reciprocals[usize::from(first)];
            each_lane(|i| mean(differences[i], first, reciprocal))
        } else {
            each_lane(|i| mean(differences[i], pairs[i], self.reciprocals[usize::from(pairs[i])]))
        }
    }
}

/// round(`sum` / 768 `pairs`), at most [`COST_MAX`], by the upper half of a product. It is exact: up to 961
/// pairs and a quotient of 255, the error of the reciprocal adds up to less than 1 / 3 n. Sums of 961 pairs times
/// 16 steps fit in 32 bits.
#[inline(always)]
fn mean(sum: u32, pairs: u16, reciprocal: u32) -> u16 {
    const MOST: u32 = COST_MAX as u32 + 1;
    let pairs = u32::from(pairs);
    let thirds = ((sum + 384 * pairs) >> 8).min(3 * MOST * pairs);
    let quotient = (u64::from(thirds) * u64::from(reciprocal)) >> 32;
    (quotient as u32).min(COST_MAX.into()) as u16
}
