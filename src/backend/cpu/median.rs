//! The weighted median of the disparities: see [`crate::backend::Stage::Median`].

use super::finest::Finest;
use super::units::{block, each_lane};
use crate::image::{Image, Plane};
use crate::maps::{flag, has_disparity};
use crate::options::Median;
use crate::plan::Plan;
use crate::weights::{MEDIAN_WEIGHT, MedianWeights};
use rayon::prelude::*;
use std::array::from_fn;

pub(super) fn run(maps: &mut Finest, plan: &Plan, guide: &Image) {
    let touched = |f: u8| match plan.method.refinement.median {
        Median::Off => false,
        Median::Filled => f & flag::FILLED != 0,
        Median::All => has_disparity(f),
    };
    smooth(&MedianWeights::of(&plan.method), touched, guide, maps);
}

/// Applies the median to every pixel whose flags are `touched`.
pub(super) fn smooth(
    weights: &MedianWeights,
    touched: impl Fn(u8) -> bool + Sync,
    guide: &Image,
    maps: &mut Finest,
) {
    // Rows of the window are vectors of one of two lengths.
    match 2 * weights.radius() + 1 {
        ..=16 => smooth_by::<16>(weights, touched, guide, maps),
        _ => smooth_by::<32>(weights, touched, guide, maps),
    }
}

/// As [`smooth`], with `LANES` lanes for each row of a window, padded where the row is shorter.
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
    disparity.for_each_init(Window::<LANES>::new, |window, (y, row)| {
        // The rows of the window, without those that it skips.
        let (apart, reach) = (step << weights.row_bits(), radius >> weights.row_bits());
        let first = y - reach.min(y / apart) * apart;
        let rows = (first..(y + reach * apart + 1).min(height)).step_by(apart);
        window.open(rows.map(|ny| (ny * seen.pitch, weights.space_row(ny.abs_diff(y) / step))));
        median_row(window, &seen, weights.doublings(), &|x| touched(flags[(x, y)]), y, row);
    });
}

/// The medians of the touched pixels of row `y`.
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
    let mut places = [0; GROUP];
    let mut all = (0..row.len()).filter(|&x| touched(x));
    loop {
        let mut count = 0;
        for (place, x) in places.iter_mut().zip(&mut all) {
            *place = x;
            count += 1;
        }
        if count == 0 {
            return;
        }
        window.medians(doublings, seen, &places[..count], y, row);
    }
}

/// The input of the windows: rows in which the columns of one window are adjacent, with unknown pixels beyond
/// both borders.
struct Seen {
    radius: usize,
    pitch: usize,
    /// Start of the window of each column's pixel, within a row.
    columns: Vec<usize>,
    guides: [Vec<u8>; 3],
    /// The largest value where there is a disparity, else 0.
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

/// Most medians are this close to the value that they replace, in 1/256 px.
const NEAR: i32 = 64;
/// The values of a window are clamped to this distance from a guess.
const FAR: i32 = i16::MAX as i32;

/// Number of pixels whose medians are found side by side: each step of one search waits for the step before.
const GROUP: usize = 4;
/// Number of samples of a window that are summed side by side; a remainder would be summed one by one.
const SIDE: usize = 32;
/// Sums of this many weights fit in 16 bits.
const PART: usize = 512;

/// The windows of a group of pixels of one row.
struct Window<const LANES: usize> {
    /// Start of each row in the input.
    rows: Vec<usize>,
    /// The weight that distance subtracts.
    space: Vec<[u8; LANES]>,
    contents: [Contents<LANES>; GROUP],
}

/// Values and weights of a window, row by row, in whole blocks of [`SIDE`]. A pixel without disparity has
/// weight 0.
#[derive(Clone, Default)]
struct Contents<const LANES: usize> {
    column: usize,
    /// Where the search for the median starts.
    guess: i32,
    /// Relative to the guess.
    values: Vec<[i16; LANES]>,
    weights: Vec<[u16; LANES]>,
    total: u32,
    /// The ends of the interval that contains the median, relative to the guess.
    low: i32,
    high: i32,
}

impl<const LANES: usize> Window<LANES> {
    fn new() -> Self {
        Self { rows: Vec::new(), space: Vec::new(), contents: from_fn(|_| Contents::default()) }
    }

    /// Sets the rows: the start of each in the input, and the weight that distance subtracts in it.
    fn open<'a>(&mut self, rows: impl Iterator<Item = (usize, &'a [u8])>) {
        self.rows.clear();
        self.space.clear();
        for (start, space) in rows {
            self.rows.push(start);
            self.space.push(from_fn(|i| space.get(i).copied().unwrap_or(u8::MAX)));
        }
        let whole = self.rows.len().next_multiple_of(SIDE / LANES);
        for Contents { values, weights, .. } in &mut self.contents {
            values.resize(whole, [0; LANES]);
            weights.clear();
            weights.resize(whole, [0; LANES]);
        }
    }

    /// Replaces the pixels `places` of row `y` by the weighted medians of their windows. Each search starts
    /// near the value that it replaces.
    #[inline(always)]
    fn medians(&mut self, doublings: u32, seen: &Seen, places: &[usize], y: usize, row: &mut [i32]) {
        let Self { rows, space, contents } = self;
        let contents = &mut contents[..places.len()];
        for (window, &x) in contents.iter_mut().zip(places) {
            (window.column, window.guess) = (seen.columns[x], row[x]);
            window.weigh(doublings, seen, rows, space, y);
            window.open(seen, rows);
        }
        while contents.iter().any(Contents::is_open) {
            for window in contents.iter_mut().filter(|window| window.is_open()) {
                window.cut();
                if !window.is_open() && window.low.abs() == FAR {
                    // The median is out of reach of this guess.
                    window.guess += window.low;
                    window.open(seen, rows);
                }
            }
        }
        for (window, &x) in contents.iter().zip(places) {
            row[x] = window.guess + window.low;
        }
    }
}

impl<const LANES: usize> Contents<LANES> {
    #[inline(always)]
    fn weigh(&mut self, doublings: u32, seen: &Seen, rows: &[usize], space: &[[u8; LANES]], y: usize) {
        let centre = y * seen.pitch + self.column + seen.radius;
        let centres = seen.guides.each_ref().map(|guide| guide[centre]);
        // The value that takes all of the weight once it is doubled.
        let most = (MEDIAN_WEIGHT + 1) >> doublings;
        for ((weights, space), &row) in self.weights.iter_mut().zip(space).zip(rows) {
            let at = row + self.column;
            let mut apart = [0u8; LANES];
            for (guide, centre) in seen.guides.iter().zip(centres) {
                let guide: &[u8; LANES] = block(guide, at);
                let above: [u8; LANES] = each_lane(|i| guide[i].saturating_sub(centre));
                let below: [u8; LANES] = each_lane(|i| centre.saturating_sub(guide[i]));
                apart = each_lane(|i| apart[i].saturating_add(above[i] | below[i]));
            }
            let known: &[u8; LANES] = block(&seen.known, at);
            let mut colour: [u8; LANES] = each_lane(|i| apart[i].min(most));
            for _ in 0..doublings {
                colour = each_lane(|i| colour[i].wrapping_add(colour[i]));
            }
            let left: [u8; LANES] = each_lane(|i| MEDIAN_WEIGHT.saturating_sub(colour[i]));
            let left: [u8; LANES] = each_lane(|i| left[i].saturating_sub(space[i]) & known[i]);
            *weights = each_lane(|i| left[i].into());
        }
    }

    /// Loads the values around the guess, and finds out which of three intervals contains the median.
    #[inline(always)]
    fn open(&mut self, seen: &Seen, rows: &[usize]) {
        for (values, &row) in self.values.iter_mut().zip(rows) {
            let seen: &[i32; LANES] = block(&seen.values, row + self.column);
            *values = each_lane(|i| (seen[i] - self.guess).clamp(-FAR, FAR) as i16);
        }
        let [below_near, below_far, total] = self.below([-NEAR, NEAR, FAR]);
        self.total = total;
        [self.low, self.high] = if 2 * below_near >= total {
            [-FAR, -NEAR]
        } else if 2 * below_far >= total {
            [1 - NEAR, NEAR]
        } else {
            [NEAR + 1, FAR]
        };
    }

    /// Whether the median is not found yet.
    #[inline(always)]
    fn is_open(&self) -> bool {
        self.low < self.high
    }

    /// Divides the interval into four and keeps the one with the median. This needs no sort.
    #[inline(always)]
    fn cut(&mut self) {
        let share = (self.high - self.low + 4) / 4;
        let ends = [1, 2, 3].map(|k| self.low + k * share - 1);
        let short = self.below(ends).iter().filter(|&&below| 2 * below < self.total).count();
        self.low += short as i32 * share;
        self.high = self.high.min(self.low + share - 1);
    }

    /// The weight of all values up to each of three ends.
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
}
