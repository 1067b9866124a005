//! Refines the disparities of half-size pixels at full size: see [`crate::backend::Stage::Refine`].
//!
//! Bands of rows are independent: a thread computes the census of a band and its surroundings, the costs of
//! its pixels and of one more row on either side, then the disparities. The costs of a pixel are [`LANES`]
//! bytes; neighbours with other labels read them at an offset of a few bytes.

use crate::backend::cpu::units::{Units, block, each_lane};
use crate::backend::cpu::volumes::Volumes;
use crate::image::{Image, Pair};
use crate::maps::FRACTION;
use crate::plan::Plan;
use crate::stage::refine::{COLUMNS, NEAR, NO_CENSUS, OTHERS, REACH};
use crate::stage::{MapSet, Optimum};
use crate::threads::prelude::*;
use std::ops::Range;

/// Half-size rows that are processed together.
const BAND: usize = 16;
/// Number of full-size disparities with costs per pixel, from [`BEFORE`] below twice its label's on.
const LANES: usize = 16;
const BEFORE: usize = REACH + 1 + 2 * NEAR;
/// Bytes past its own costs that a pixel may read; they belong to the next pixel, and are ignored.
const FARTHER: usize = 4 * NEAR;
/// Number of sums: the disparities to compare, and one more on either side.
const SUMS: usize = 2 * REACH + 3;
/// Index of the sum for twice the label's disparity.
const OWN: usize = REACH + 1;
const _: () = assert!(SUMS + FARTHER <= LANES);
/// Bits of the rank of a sum, which breaks ties; the largest sum of costs fits in the others.
const RANK_BITS: u32 = 4;
/// Sums by rank: first twice the label's disparity, then by distance from it, the smaller disparity first.
const BY_RANK: [usize; 1 << RANK_BITS] = {
    let mut sums = [OWN; 1 << RANK_BITS];
    let mut k = 1;
    while k <= REACH {
        (sums[2 * k - 1], sums[2 * k]) = (OWN - k, OWN + k);
        k += 1;
    }
    sums
};
/// The rank of each sum; all bits are set for sums that are not compared.
const RANKS: [u16; LANES] = {
    let mut ranks = [u16::MAX; LANES];
    let mut rank = 0;
    while rank <= 2 * REACH {
        ranks[BY_RANK[rank]] = rank as u16;
        rank += 1;
    }
    ranks
};
/// Radius of the census.
const RADIUS: usize = 2;

pub(super) fn run<U: Units>(v: &mut Volumes<U>) {
    let Volumes { plan, pair, maps: MapSet { optima, raw, disparity, .. }, .. } = v;
    let (width, height) = plan.size();
    let views = Views::new(plan, pair.full().expect("the pair at full size"));
    let cells = BAND * width;
    let bands = raw.data_mut().par_chunks_mut(cells).zip(disparity.data_mut().par_chunks_mut(cells));
    bands.enumerate().for_each_init(Scratch::default, |scratch, (band, (raw, disparity))| {
        let rows = band * BAND..height.min((band + 1) * BAND);
        let seen = rows.start.saturating_sub(1)..height.min(rows.end + 1);
        scratch.fill(&views, &seen, |y| optima.row(y));
        for (y, raw) in rows.zip(raw.chunks_exact_mut(width)) {
            let around = [y.saturating_sub(1), y, (y + 1).min(height - 1)];
            let near = around.map(|y| (optima.row(y), scratch.costs_of(y - seen.start, width)));
            // At the borders of the image, the repeated row counts once.
            let first = usize::from(y == 0);
            let end = 3 - usize::from(y + 1 == height);
            fit_row(&near, first..end, plan.range.min, raw);
        }
        disparity.copy_from_slice(raw);
    });
}

/// The views at full size, and constants of all rows.
struct Views<'a> {
    left: View<'a>,
    right: View<'a>,
    half_min: i32,
    /// Columns without a census on either side of a row of the right view.
    margin: usize,
}

impl<'a> Views<'a> {
    fn new(plan: &Plan, full: &'a Pair) -> Self {
        let range = plan.range;
        // Neither labels nor rows of the view reach farther.
        let farthest = 2 * range.min.unsigned_abs().max(range.max.unsigned_abs()) as usize + LANES;
        let margin = farthest.min(full.size().0 + LANES);
        let view = |image: &'a Image, mirrored| View { image, mirrored, any_masked: image.any_masked() };
        Self { left: view(full.left(), false), right: view(full.right(), true), half_min: range.min, margin }
    }
}

/// A view, read from right to left if `mirrored`.
struct View<'a> {
    image: &'a Image,
    mirrored: bool,
    any_masked: bool,
}

/// Scratch memory of a thread.
#[derive(Default)]
struct Scratch {
    greys: Vec<u16>,
    left: Vec<u16>,
    /// Mirrored, with margins.
    right: Vec<u16>,
    /// [`LANES`] bytes per pixel, and [`FARTHER`] after the last.
    costs: Vec<u8>,
}

impl Scratch {
    /// Computes the costs of half-size `rows`.
    fn fill<'a>(&mut self, views: &Views, rows: &Range<usize>, optima: impl Fn(usize) -> &'a [Optimum]) {
        let Self { greys, left, right, costs } = self;
        let (width, margin) = (views.left.image.width(), views.margin);
        let full = 2 * rows.start..2 * rows.end;
        left.resize(full.len() * width, 0);
        views.left.census(&full, greys, (left, 0));
        right.resize(full.len() * (width + 2 * margin), 0);
        views.right.census(&full, greys, (right, margin));
        costs.resize(rows.len() * width / 2 * LANES + FARTHER, 0);
        let blocks = left.chunks_exact(2 * width).zip(right.chunks_exact(2 * (width + 2 * margin)));
        for ((y, costs), (left, right)) in
            rows.clone().zip(costs.chunks_exact_mut(width / 2 * LANES)).zip(blocks)
        {
            cost_row(left.split_at(width), right.split_at(right.len() / 2), optima(y), views, costs);
        }
    }

    fn costs_of(&self, row: usize, width: usize) -> &[u8] {
        &self.costs[row * width * LANES..][..width * LANES + FARTHER]
    }
}

impl View<'_> {
    /// The census of `rows`, with `margin` columns without a census on either side.
    fn census(&self, rows: &Range<usize>, greys: &mut Vec<u16>, (out, margin): (&mut [u16], usize)) {
        let Self { image, mirrored, .. } = *self;
        let (width, height) = image.pixels.size();
        // Greys with replicated borders; masked ones are the largest value, which is below no other.
        let pitch = width + 2 * RADIUS;
        greys.resize((rows.len() + 2 * RADIUS) * pitch, 0);
        for (y, greys) in (rows.start..).zip(greys.chunks_exact_mut(pitch)) {
            let y = y.saturating_sub(RADIUS).min(height - 1);
            let inside = greys[RADIUS..RADIUS + width].iter_mut();
            let pixels = image.pixels.row(y).iter();
            if mirrored {
                inside.zip(pixels.rev()).for_each(|(out, pixel)| *out = pixel[3]);
            } else {
                inside.zip(pixels).for_each(|(out, pixel)| *out = pixel[3]);
            }
            for x in self.masked_columns(y) {
                greys[RADIUS + x] = u16::MAX;
            }
            let (first, last) = (greys[RADIUS], greys[RADIUS + width - 1]);
            greys[..RADIUS].fill(first);
            greys[RADIUS + width..].fill(last);
        }
        for (i, out) in out.chunks_exact_mut(width + 2 * margin).enumerate() {
            out[..margin].fill(NO_CENSUS);
            out[margin + width..].fill(NO_CENSUS);
            let out = &mut out[margin..margin + width];
            census_row(&greys[i * pitch..][..(2 * RADIUS + 1) * pitch], pitch, mirrored, out);
            for x in self.masked_columns(rows.start + i) {
                out[x] = NO_CENSUS;
            }
        }
    }

    /// The columns of masked pixels in a row.
    fn masked_columns(&self, y: usize) -> impl Iterator<Item = usize> {
        let Self { image, mirrored, any_masked } = *self;
        let row = if any_masked { image.masked.row(y) } else { &[] };
        let masked = row.iter().enumerate().filter(|(_, masked)| **masked);
        masked.map(move |(x, _)| if mirrored { image.width() - 1 - x } else { x })
    }
}

#[pulp::with_simd(census_row = crate::vectors::widest())]
#[inline(always)]
fn census_row_on<'a, S: pulp::Simd>(
    _: S,
    greys: &'a [u16],
    pitch: usize,
    mirrored: bool,
    out: &'a mut [u16],
) {
    let width = out.len();
    let line = |dx: isize, dy: isize| {
        let start = (RADIUS as isize + dy) * pitch as isize + RADIUS as isize + dx;
        &greys[start as usize..][..width]
    };
    let centre = line(0, 0);
    out.fill(0);
    for (dx, dy) in OTHERS {
        let other = line(if mirrored { -dx } else { dx }, dy);
        for ((bits, &other), &centre) in out.iter_mut().zip(other).zip(centre) {
            *bits = *bits << 1 | u16::from(other < centre);
        }
    }
}

/// The costs of a row of half-size pixels.
#[pulp::with_simd(cost_row = crate::vectors::widest())]
#[inline(always)]
fn cost_row_on<'a, S: pulp::Simd>(
    _: S,
    left: (&'a [u16], &'a [u16]),
    right: (&'a [u16], &'a [u16]),
    optima: &'a [Optimum],
    views: &'a Views<'a>,
    out: &'a mut [u8],
) {
    let width = left.0.len();
    let rows = [(left.0, right.0), (left.1, right.1)];
    for (x, (optimum, out)) in optima.iter().zip(out.as_chunks_mut::<LANES>().0).enumerate() {
        let first = 2 * (i32::from(optimum.label) + views.half_min) - BEFORE as i32;
        // Differing bits of the lower and upper half of each census, one byte each.
        let mut sums = [0u8; 2 * LANES];
        for (left, right) in rows {
            let most = (right.len() - LANES) as i32;
            for column in [2 * x, 2 * x + 1] {
                // The right pixel of a disparity D is at `width` - 1 - `column` + D from the right.
                let place = (views.margin + width - 1 - column) as i32 + first;
                let there: &[u16; LANES] = block(right, place.clamp(0, most) as usize);
                let differing: [u16; LANES] = each_lane(|i| left[column] ^ there[i]);
                let bytes: [u8; 2 * LANES] = bytemuck::cast(differing);
                sums = each_lane(|i| sums[i] + bytes[i].count_ones() as u8);
            }
        }
        let words: [u16; LANES] = bytemuck::cast(sums);
        *out = each_lane(|i| (words[i] + (words[i] >> 8)) as u8);
    }
}

/// The disparities of a row, from the optima and costs of the row above, itself and the row below; only the
/// rows in `inside` exist.
#[pulp::with_simd(fit_row = crate::vectors::widest())]
#[inline(always)]
fn fit_row_on<'a, S: pulp::Simd>(
    _: S,
    rows: &'a [(&'a [Optimum], &'a [u8]); 3],
    inside: Range<usize>,
    half_min: i32,
    out: &'a mut [i32],
) {
    let width = out.len();
    for (x, out) in out.iter_mut().enumerate() {
        let label = i32::from(rows[1].0[x].label);
        let mut sums = [0u16; LANES];
        for (optima, costs) in &rows[inside.clone()] {
            for column in x.saturating_sub(COLUMNS)..(x + COLUMNS + 1).min(width) {
                let above = label - i32::from(optima[column].label) + NEAR as i32;
                if (0..=2 * NEAR as i32).contains(&above) {
                    let costs: &[u8; LANES] = block(costs, LANES * column + 2 * above as usize);
                    sums = each_lane(|i| sums[i] + u16::from(costs[i]));
                }
            }
        }
        // Sum and rank in one number.
        let keys: [u16; LANES] = each_lane(|at| (sums[at] << RANK_BITS) | RANKS[at]);
        let least = keys.into_iter().fold(u16::MAX, u16::min);
        let best = BY_RANK[usize::from(least) % BY_RANK.len()];
        // Copied, because indexing would force the sums above out of registers.
        let sums: [u16; LANES] = std::hint::black_box(sums);
        let [a, b, c] = [best - 1, best, best + 1].map(|at| i32::from(sums[at]));
        let slope = a.max(c) - b;
        let offset = if slope <= 0 {
            0
        } else {
            (FRACTION * (a - c) + slope).div_euclid(2 * slope).clamp(-FRACTION, FRACTION)
        };
        let disparity = 2 * (label + half_min) + best as i32 - OWN as i32;
        *out = (FRACTION * disparity + offset + 1) >> 1;
    }
}
