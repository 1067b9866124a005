//! Weighted medians of the disparities: see [`crate::backend::Stage::Median`] and
//! [`crate::backend::Stage::FillMedian`].

use super::Finest;
use super::units::block;
use crate::image::{Image, Plane};
use crate::maps::{flag, has_disparity};
use crate::options::Median;
use crate::plan::Plan;
use crate::tables::{MEDIAN_WEIGHT, MedianWeights};
use rayon::prelude::*;
use std::array::from_fn;

pub(super) fn run(plan: &Plan, guide: &Image, maps: &mut Finest) {
    let touched = |f: u8| match plan.method.median {
        Median::Off => false,
        Median::Filled => f & flag::FILLED != 0,
        Median::All => has_disparity(f),
    };
    smooth(&MedianWeights::of(&plan.method), touched, guide, maps);
}

pub(super) fn fill(plan: &Plan, guide: &Image, maps: &mut Finest) {
    smooth(&MedianWeights::stretched(&plan.method), |f| f & flag::FILLED != 0, guide, maps);
}

/// Replaces the disparity of every pixel whose flags are `touched`.
fn smooth(weights: &MedianWeights, touched: impl Fn(u8) -> bool + Sync, guide: &Image, maps: &mut Finest) {
    // Rows of the window are vectors of one length or another.
    match 2 * weights.radius() + 1 {
        ..=16 => smooth_by::<16>(weights, touched, guide, maps),
        _ => smooth_by::<32>(weights, touched, guide, maps),
    }
}

/// As [`smooth`], with `LANES` places for each row of a window: padded where they are more than it has.
fn smooth_by<const LANES: usize>(
    weights: &MedianWeights,
    touched: impl Fn(u8) -> bool + Sync,
    guide: &Image,
    maps: &mut Finest,
) {
    let Finest { disparity, validity: flags, .. } = maps;
    let (width, height) = disparity.size();
    let (radius, step) = (weights.radius(), 1 << weights.step_bits());
    let seen = Seen::new(weights, LANES, guide, disparity, flags);
    let disparity = disparity.data_mut().par_chunks_mut(width).enumerate();
    disparity.for_each_init(
        || Window::<LANES>::new(radius),
        |window, (y, row)| {
            // The window's rows, in between those that it does not see.
            let (apart, reach) = (step << weights.row_bits(), radius >> weights.row_bits());
            let first = y - reach.min(y / apart) * apart;
            let rows = (first..(y + reach * apart + 1).min(height)).step_by(apart);
            window.open(rows.map(|ny| (ny * seen.pitch, weights.space_row(ny.abs_diff(y) / step))));
            median_row(window, &seen, weights.doublings(), &|x| touched(flags[(x, y)]), y, row);
        },
    );
}

/// The medians of row `y`, where it is touched.
#[pulp::with_simd(median_row = pulp::Arch::new())]
#[inline(always)]
fn median_row_on<'a, S: pulp::Simd, const LANES: usize>(
    _: S,
    window: &'a mut Window<LANES>,
    seen: &'a Seen,
    doublings: u32,
    touched: &'a dyn Fn(usize) -> bool,
    y: usize,
    row: &'a mut [i32],
) {
    for (x, value) in row.iter_mut().enumerate().filter(|&(x, _)| touched(x)) {
        *value = window.median(doublings, seen, seen.columns[x], y, *value);
    }
}

/// What the windows see: rows in which the columns of a window are side by side, with unknown ones beyond both borders.
struct Seen {
    radius: usize,
    pitch: usize,
    /// Where the window of the pixel of each column starts in a row.
    columns: Vec<usize>,
    guides: [Vec<u8>; 3],
    /// The largest there is where there is a disparity, else 0.
    known: Vec<u8>,
    values: Vec<i32>,
}

impl Seen {
    fn new(
        weights: &MedianWeights,
        lanes: usize,
        guide: &Image,
        disparity: &Plane<i32>,
        flags: &Plane<u8>,
    ) -> Self {
        let (width, height) = disparity.size();
        let (radius, step) = (weights.radius(), 1 << weights.step_bits());
        let mut columns = vec![0; width];
        let mut start = 0;
        for phase in 0..step.min(width) {
            for (place, x) in (phase..width).step_by(step).enumerate() {
                columns[x] = start + place;
            }
            start += (width - phase).div_ceil(step) + 2 * radius;
        }
        let pitch = start + lanes;
        let mut seen = Self {
            radius,
            pitch,
            columns,
            guides: [(); 3].map(|()| vec![0; pitch * height]),
            known: vec![0; pitch * height],
            values: vec![0; pitch * height],
        };
        let [r, g, b] = &mut seen.guides;
        let guides = r.par_chunks_mut(pitch).zip(g.par_chunks_mut(pitch)).zip(b.par_chunks_mut(pitch));
        let rows = guides.zip(seen.known.par_chunks_mut(pitch)).zip(seen.values.par_chunks_mut(pitch));
        rows.enumerate().for_each(|(y, ((((r, g), b), known), values))| {
            for (x, &column) in seen.columns.iter().enumerate() {
                let at = column + radius;
                let scaled = guide.pixels[(x, y)].map(|v| ((u32::from(v) * weights.scale()) >> 16) as u8);
                (r[at], g[at], b[at]) = (scaled[0], scaled[1], scaled[2]);
                known[at] = if has_disparity(flags[(x, y)]) { u8::MAX } else { 0 };
                values[at] = disparity[(x, y)];
            }
        });
        seen
    }
}

/// How near to what it replaces a median mostly is, in 1/256 px.
const NEAR: i32 = 64;
/// The values of a window are seen as far as this around a guess.
const FAR: i32 = i16::MAX as i32;

/// Sums of so many weights fit 16 bits.
const PART: usize = 512;

/// Values and weights of a window, row by row. What has no disparity has no weight.
struct Window<const LANES: usize> {
    /// Where its rows start in what it sees.
    rows: Vec<usize>,
    /// What distance takes off the weights.
    space: Vec<[u8; LANES]>,
    /// Relative to the guess.
    values: Vec<[i16; LANES]>,
    weights: Vec<[u16; LANES]>,
}

impl<const LANES: usize> Window<LANES> {
    fn new(radius: usize) -> Self {
        let rows = 2 * radius + 1;
        Self {
            rows: Vec::with_capacity(rows),
            space: Vec::with_capacity(rows),
            values: Vec::with_capacity(rows),
            weights: Vec::with_capacity(rows),
        }
    }

    /// Takes rows: where each starts in what is seen, and what distance takes off in it.
    fn open<'a>(&mut self, rows: impl Iterator<Item = (usize, &'a [u8])>) {
        self.rows.clear();
        self.space.clear();
        for (start, space) in rows {
            self.rows.push(start);
            self.space.push(from_fn(|i| space.get(i).copied().unwrap_or(u8::MAX)));
        }
        self.values.resize(self.rows.len(), [0; LANES]);
        self.weights.resize(self.rows.len(), [0; LANES]);
    }

    /// The weighted median of the window whose rows start at `column`, around a pixel of row `y`; it is sought near `guess`
    /// first.
    #[inline(always)]
    fn median(&mut self, doublings: u32, seen: &Seen, column: usize, y: usize, mut guess: i32) -> i32 {
        self.weigh(doublings, seen, column, y);
        loop {
            for (values, &row) in self.values.iter_mut().zip(&self.rows) {
                let seen: &[i32; LANES] = block(&seen.values, row + column);
                *values = from_fn(|i| (seen[i] - guess).clamp(-FAR, FAR) as i16);
            }
            let found = self.search();
            guess += found;
            if found.abs() < FAR {
                return guess;
            }
        }
    }

    #[inline(always)]
    fn weigh(&mut self, doublings: u32, seen: &Seen, column: usize, y: usize) {
        let centre = y * seen.pitch + column + seen.radius;
        let [r, g, b] = &seen.guides;
        let (cr, cg, cb) = (r[centre], g[centre], b[centre]);
        // What takes off all of the weight, doubled.
        let most = (MEDIAN_WEIGHT + 1) >> doublings;
        for ((weights, space), &row) in self.weights.iter_mut().zip(&self.space).zip(&self.rows) {
            let at = row + column;
            let (r, g, b): (&[u8; LANES], &[u8; LANES], &[u8; LANES]) =
                (block(r, at), block(g, at), block(b, at));
            let known: &[u8; LANES] = block(&seen.known, at);
            let apart: [u8; LANES] = from_fn(|i| r[i].abs_diff(cr).saturating_add(g[i].abs_diff(cg)));
            let apart: [u8; LANES] = from_fn(|i| apart[i].saturating_add(b[i].abs_diff(cb)));
            let colour: [u8; LANES] = from_fn(|i| apart[i].min(most) << doublings);
            let left: [u8; LANES] = from_fn(|i| MEDIAN_WEIGHT.saturating_sub(colour[i]));
            *weights = from_fn(|i| u16::from(left[i].saturating_sub(space[i]) & known[i]));
        }
    }

    /// The weights of values up to each of three.
    #[inline(always)]
    fn below(&self, ends: [i32; 3]) -> [u32; 3] {
        let [a, b, c] = ends.map(|end| end.min(FAR) as i16);
        let mut sums = [0; 3];
        let parts = self.values.as_flattened().chunks(PART).zip(self.weights.as_flattened().chunks(PART));
        for (values, weights) in parts {
            let mut part = [0u16; 3];
            for (&v, &w) in values.iter().zip(weights) {
                part[0] = part[0].wrapping_add(if v <= a { w } else { 0 });
                part[1] = part[1].wrapping_add(if v <= b { w } else { 0 });
                part[2] = part[2].wrapping_add(if v <= c { w } else { 0 });
            }
            sums.iter_mut().zip(part).for_each(|(sum, part)| *sum += u32::from(part));
        }
        sums
    }

    /// The smallest value at which half of the weight is reached.
    #[inline(always)]
    fn search(&self) -> i32 {
        let [below_near, below_far, total] = self.below([-NEAR, NEAR, FAR]);
        let [mut low, mut high] = if 2 * below_near >= total {
            [-FAR, -NEAR]
        } else if 2 * below_far >= total {
            [1 - NEAR, NEAR]
        } else {
            [NEAR + 1, FAR]
        };
        // Cutting an interval into four needs no sort.
        while low < high {
            let share = (high - low + 4) / 4;
            let ends = [1, 2, 3].map(|k| low + k * share - 1);
            let short = self.below(ends).iter().filter(|&&below| 2 * below < total).count();
            low += short as i32 * share;
            high = high.min(low + share - 1);
        }
        low
    }
}
