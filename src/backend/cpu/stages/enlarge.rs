//! Upsampled maps: see [`crate::backend::Stage::Enlarge`].
//!
//! Most pixels are far from edges and are interpolated. Only the others examine their neighbourhood.

use crate::backend::cpu::units::each_lane;
use crate::image::{Image, Pair, Pixel, Plane};
use crate::maps::{FRACTION, Maps, flag, has_disparity};
use crate::plan::Plan;
use crate::stage::MapSet;
use crate::stage::enlarge::{AWAY, NEAR};
use crate::threads::prelude::*;

pub(super) fn run(maps: &mut MapSet, plan: &Plan, pair: &Pair) {
    let image = pair.full().expect("the pair at full size").left();
    let range = plan.of_pair().range;
    let (low, high) = (FRACTION * range.min, FRACTION * range.max);
    let above_low = maps.disparity.map(|d| (2 * d).clamp(low, high) - low);
    let MapSet { raw, confidence, validity, full, .. } = maps;
    let half = Half { low, above_low, validity, confidence, colours: &pair.left().pixels };
    let (width, any_masked) = (half.above_low.width(), image.any_masked());
    let Maps { disparity, raw: full_raw, confidence: full_confidence, validity: full_validity, .. } = full;
    // Two full-size rows per half-size row.
    let maps =
        disparity.data_mut().par_chunks_mut(4 * width).zip(full_raw.data_mut().par_chunks_mut(4 * width));
    let flags = full_confidence
        .data_mut()
        .par_chunks_mut(4 * width)
        .zip(full_validity.data_mut().par_chunks_mut(4 * width));
    maps.zip(flags).enumerate().for_each_init(Scratch::default, |scratch, (y, (maps, flags))| {
        let ((disparity, full_raw), (confidence, validity)) = (maps, flags);
        twice(raw.row(y), full_raw, |raw| (2 * raw).clamp(low, high));
        twice(half.confidence.row(y), confidence, |confidence| confidence);
        twice(half.validity.row(y), validity, |validity| validity);
        half.interpolate(y, scratch, disparity);
        edges_row(&half, image, y, &scratch.plain, (disparity, validity, confidence));
        let masked = if any_masked { &image.masked.data()[4 * width * y..][..4 * width] } else { &[] };
        for (at, _) in masked.iter().enumerate().filter(|(_, masked)| **masked) {
            let own = half.above_low[(at % (2 * width) / 2, y)];
            (disparity[at], validity[at], confidence[at]) = (low + own, flag::MASKED, 0);
        }
    });
}

/// The pixels of the two full-size rows of row `y` that are not `plain`.
#[pulp::with_simd(edges_row = crate::vectors::widest())]
#[inline(always)]
fn edges_row_on<'a, S: pulp::Simd>(
    _: S,
    half: &'a Half<'a>,
    image: &'a Image,
    y: usize,
    plain: &'a [bool],
    (disparity, validity, confidence): (&'a mut [i32], &'a mut [u8], &'a mut [u8]),
) {
    let width = plain.len();
    for x in (0..width).filter(|&x| !plain[x]) {
        if let Some(around) = half.around((x, y)) {
            for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let at = 2 * width * j + 2 * x + i;
                let colour = image.pixels[(2 * x + i, 2 * y + j)];
                let (above_low, like) = around.at((i, j), colour);
                disparity[at] = half.low + above_low;
                (validity[at], confidence[at]) = (half.validity[like], half.confidence[like]);
            }
        } else {
            let own = half.low + half.above_low[(x, y)];
            let places = [0, 1, 2 * width, 2 * width + 1].map(|at| 2 * x + at);
            for at in places {
                disparity[at] = own;
            }
        }
    }
}

/// Writes each value of a row to the four pixels of its block.
fn twice<T: Copy, U: Copy>(row: &[T], out: &mut [U], value: impl Fn(T) -> U) {
    let (above, below) = out.split_at_mut(2 * row.len());
    for (out, &from) in above.as_chunks_mut::<2>().0.iter_mut().zip(row) {
        *out = [value(from); 2];
    }
    below.copy_from_slice(above);
}

/// The maps at half size.
struct Half<'a> {
    /// The smallest disparity at full size; others are relative to it, so that sums fit in 32 bits.
    low: i32,
    above_low: Plane<i32>,
    validity: &'a Plane<u8>,
    confidence: &'a Plane<u8>,
    colours: &'a Plane<Pixel>,
}

#[derive(Default)]
struct Scratch {
    low: Vec<i32>,
    high: Vec<i32>,
    sums: Vec<i32>,
    /// Pixels that are not near an edge, and have a disparity like all their neighbours.
    plain: Vec<bool>,
}

impl Half<'_> {
    /// The 3 x 3 neighbourhood of a pixel; `None` if the pixel has no disparity.
    #[inline(always)]
    fn around(&self, (x, y): (usize, usize)) -> Option<Around> {
        if !has_disparity(self.validity[(x, y)]) {
            return None;
        }
        let (width, height) = self.above_low.size();
        let beside = |at: usize, end: usize| [usize::from(at == 0), 2 - usize::from(at + 1 == end)];
        let beside = [beside(x, width), beside(y, height)];
        let mut around = Around { own: (x, y), beside, ..Around::default() };
        for row in y.saturating_sub(1)..(y + 2).min(height) {
            for column in x.saturating_sub(1)..(x + 2).min(width) {
                let (at, k) = ((column, row), 3 * (row + 1 - y) + column + 1 - x);
                if has_disparity(self.validity[at]) {
                    around.known[k] = true;
                    around.above_low[k] = self.above_low[at];
                    let levels = self.colours[at].map(|channel| (channel >> 8) as i16);
                    around.colours.iter_mut().zip(levels).for_each(|(channel, level)| channel[k] = level);
                }
            }
        }
        let Around { known, above_low, .. } = &around;
        let least = each_known(known, above_low, i32::MAX).into_iter().fold(i32::MAX, i32::min);
        let most = each_known(known, above_low, i32::MIN).into_iter().fold(i32::MIN, i32::max);
        around.is_flat = most - least <= FRACTION;
        Some(around)
    }

    /// Interpolates the two full-size rows of row `y`, and finds the pixels for which that suffices.
    fn interpolate(&self, y: usize, scratch: &mut Scratch, out: &mut [i32]) {
        let (width, height) = self.above_low.size();
        let Scratch { low, high, sums, plain } = scratch;
        for room in [&mut *low, high, sums] {
            room.resize(width + 2, 0);
        }
        plain.resize(width, false);
        let above = self.above_low.row(y.saturating_sub(1));
        let (own, below) = (self.above_low.row(y), self.above_low.row((y + 1).min(height - 1)));
        flat_row([above, own, below], low, high, plain);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        let hole = |x: &usize| rows.clone().any(|y| !has_disparity(self.validity[(*x, y)]));
        for x in (0..width).filter(hole) {
            plain[x.saturating_sub(1)..(x + 2).min(width)].fill(false);
        }
        let (first, second) = out.split_at_mut(2 * width);
        between_row(self.low, (own, above), sums, first);
        between_row(self.low, (own, below), sums, second);
    }
}

/// Lanes for a 3 x 3 neighbourhood in raster order.
const LANES: usize = 16;
/// Dissimilarity of unknown pixels: more than three channels and the distance can give.
const UNKNOWN: i16 = 3 * 255 + 8 * AWAY as i16 + 1;
const _: () = assert!((UNKNOWN as i32 + 1) * LANES as i32 <= i16::MAX as i32);

/// The 3 x 3 neighbourhood of a half-size pixel.
#[derive(Default)]
struct Around {
    own: (usize, usize),
    /// Columns (0 to 2) of the neighbours to the left and right, clamped to the image; then rows likewise.
    beside: [[usize; 2]; 2],
    /// Whether pixels are inside and have a disparity.
    known: [bool; LANES],
    above_low: [i32; LANES],
    /// Whether the known disparities span at most a full-size pixel.
    is_flat: bool,
    /// Red, green and blue in 8-bit levels.
    colours: [[i16; LANES]; 3],
}

/// The distance terms of the dissimilarity, for a pixel in column i and row j of the block.
const fn away((i, j): (usize, usize)) -> [i16; LANES] {
    let mut away = [0; LANES];
    let mut k = 0;
    while k < 9 {
        // In half pixels: 3, 1 and 5, or the reverse.
        let (x, y) = (4 * (k % 3) as i32 - 3 - 2 * i as i32, 4 * (k / 3) as i32 - 3 - 2 * j as i32);
        away[k] = (AWAY * (x.abs() + y.abs()) / 2) as i16;
        k += 1;
    }
    away
}

const DISTANCES: [[[i16; LANES]; 2]; 2] = [[away((0, 0)), away((0, 1))], [away((1, 0)), away((1, 1))]];

impl Around {
    /// The relative disparity of a full-size pixel of this `colour` in the block, and the half-size pixel
    /// most similar to it.
    #[inline(always)]
    fn at(&self, (i, j): (usize, usize), colour: Pixel) -> (i32, (usize, usize)) {
        let Self { own, beside, known, above_low, is_flat, colours } = self;
        if *is_flat {
            // Pixels without a disparity are replaced by the centre.
            let value = |k: usize| above_low[if known[k] { k } else { 4 }];
            let (x, y) = (beside[0][i], 3 * beside[1][j]);
            return ((9 * value(4) + 3 * value(3 + x) + 3 * value(y + 1) + value(y + x) + 8) >> 4, *own);
        }
        let [red, green, blue] = [0, 1, 2].map(|c: usize| (colour[c] >> 8) as i16);
        let unlike: [i16; LANES] = each_lane(|k| {
            let apart =
                (colours[0][k] - red).abs() + (colours[1][k] - green).abs() + (colours[2][k] - blue).abs();
            if known[k] { apart + DISTANCES[i][j][k] } else { UNKNOWN }
        });
        // Dissimilarity and index in one number.
        let keys: [i16; LANES] = each_lane(|k| unlike[k] * LANES as i16 + k as i16);
        let least = keys.into_iter().fold(i16::MAX, i16::min) as usize;
        let (smallest, best) = ((least / LANES) as i16, least % LANES);
        let apart: [i32; LANES] = each_lane(|k| above_low[k] - above_low[best]);
        let weights: [i32; LANES] = each_lane(|k| {
            let weight = (NEAR + i32::from(smallest) - i32::from(unlike[k])).max(0);
            if apart[k].abs() <= FRACTION { weight } else { 0 }
        });
        let sums: [i32; LANES] = each_lane(|k| weights[k] * apart[k]);
        let value = above_low[best] + sums.into_iter().sum::<i32>() / weights.into_iter().sum::<i32>();
        (value, (own.0 + best % 3 - 1, own.1 + best / 3 - 1))
    }
}

/// The known values, with `other` in place of the rest.
#[inline(always)]
fn each_known(known: &[bool; LANES], values: &[i32; LANES], other: i32) -> [i32; LANES] {
    each_lane(|k| if known[k] { values[k] } else { other })
}

/// Whether the disparities of each 3 x 3 neighbourhood span at most a full-size pixel.
#[pulp::with_simd(flat_row = crate::vectors::widest())]
#[inline(always)]
fn flat_row_on<'a, S: pulp::Simd>(
    _: S,
    rows: [&'a [i32]; 3],
    low: &'a mut [i32],
    high: &'a mut [i32],
    flat: &'a mut [bool],
) {
    let width = flat.len();
    let [a, b, c] = rows.map(|row| &row[..width]);
    for (x, (low, high)) in low[1..=width].iter_mut().zip(&mut high[1..=width]).enumerate() {
        *low = a[x].min(b[x]).min(c[x]);
        *high = a[x].max(b[x]).max(c[x]);
    }
    for ends in [&mut *low, high] {
        (ends[0], ends[width + 1]) = (ends[1], ends[width]);
    }
    let (low, high) = (&low[..width + 2], &high[..width + 2]);
    for (x, flat) in flat.iter_mut().enumerate() {
        let most = high[x].max(high[x + 1]).max(high[x + 2]);
        let least = low[x].min(low[x + 1]).min(low[x + 2]);
        *flat = most - least <= FRACTION;
    }
}

/// Interpolates a full-size row between its half-size row and the neighbour of that.
#[pulp::with_simd(between_row = crate::vectors::widest())]
#[inline(always)]
fn between_row_on<'a, S: pulp::Simd>(
    _: S,
    low: i32,
    (own, beside): (&'a [i32], &'a [i32]),
    sums: &'a mut [i32],
    out: &'a mut [i32],
) {
    let width = own.len();
    for (sum, (own, beside)) in sums[1..=width].iter_mut().zip(own.iter().zip(beside)) {
        *sum = 3 * own + beside;
    }
    (sums[0], sums[width + 1]) = (sums[1], sums[width]);
    let sums = &sums[..width + 2];
    for (x, out) in out.as_chunks_mut::<2>().0.iter_mut().enumerate() {
        let here = 3 * sums[x + 1] + 8;
        *out = [low + ((here + sums[x]) >> 4), low + ((here + sums[x + 2]) >> 4)];
    }
}
