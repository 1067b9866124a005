//! The maps at full size: see [`crate::backend::Stage::Enlarge`].
//!
//! Most pixels are far from every edge, and interpolate. The others look at the 3 x 3 half-size pixels around them.

use crate::image::{Image, Pair, Pixel, Plane};
use crate::maps::{FRACTION, Maps, flag, has_disparity};
use crate::plan::Plan;
use crate::stage::MapSet;
use crate::stage::enlarge::{AWAY, NEAR};
use rayon::prelude::*;
use std::ops::Range;

pub(super) fn run(maps: &mut MapSet, plan: &Plan, pair: &Pair) {
    let image = pair.full().expect("the pair at full size").left();
    let range = plan.of_pair().range;
    let (low, high) = (FRACTION * range.min, FRACTION * range.max);
    let above_low = maps.disparity.map(|d| (2 * d).clamp(low, high) - low);
    let MapSet { raw, confidence, validity, full, .. } = maps;
    let half = Half { low, above_low, validity, confidence, colours: &pair.left().pixels };
    let width = half.above_low.width();
    let Maps { disparity, raw: full_raw, confidence: full_confidence, validity: full_validity, .. } = full;
    // Two rows of the full size for one of half of it.
    let maps =
        disparity.data_mut().par_chunks_mut(4 * width).zip(full_raw.data_mut().par_chunks_mut(4 * width));
    let flags = full_confidence
        .data_mut()
        .par_chunks_mut(4 * width)
        .zip(full_validity.data_mut().par_chunks_mut(4 * width));
    maps.zip(flags).enumerate().for_each_init(Scratch::default, |scratch, (y, (maps, flags))| {
        let ((disparity, full_raw), (confidence, validity)) = (maps, flags);
        twice(raw.row(y), full_raw, |raw| 2 * raw);
        twice(half.confidence.row(y), confidence, |confidence| confidence);
        twice(half.validity.row(y), validity, |validity| validity);
        half.interpolate(y, scratch, disparity);
        for x in (0..width).filter(|&x| !scratch.plain[x]) {
            let around = half.around((x, y));
            for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let (column, row) = (2 * x + i, 2 * y + j);
                let at = 2 * width * j + column;
                let (value, like) = half.at_edge((x, y), &around, (column, row), image);
                (disparity[at], validity[at], confidence[at]) =
                    (low + value, half.validity[like], half.confidence[like]);
            }
        }
        let masked = &image.masked.data()[4 * width * y..][..4 * width];
        for (at, _) in masked.iter().enumerate().filter(|(_, masked)| **masked) {
            let own = half.above_low[(at % (2 * width) / 2, y)];
            (disparity[at], validity[at], confidence[at]) = (low + own, flag::MASKED, 0);
        }
    });
}

/// Writes each value of a row to the four pixels of its block.
fn twice<T: Copy, U: Copy>(row: &[T], out: &mut [U], value: impl Fn(T) -> U) {
    let (above, below) = out.split_at_mut(2 * row.len());
    for (out, &from) in above.as_chunks_mut::<2>().0.iter_mut().zip(row) {
        *out = [value(from); 2];
    }
    below.copy_from_slice(above);
}

/// The maps at half the size.
struct Half<'a> {
    /// The smallest disparity of the full size, and how far the others are above it: sums of those fit 32 bits.
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
    /// Pixels of the row around which there is no edge, and which has a disparity as all around it.
    plain: Vec<bool>,
}

impl Half<'_> {
    /// The 3 x 3 around a pixel that are inside.
    fn around(&self, (x, y): (usize, usize)) -> [Range<usize>; 2] {
        let (width, height) = self.above_low.size();
        [(x, width), (y, height)].map(|(at, end)| at.saturating_sub(1)..(at + 2).min(end))
    }

    /// Interpolates the two rows of the full size of row `y`, and finds where that is enough.
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
        let [_, rows] = self.around((0, y));
        let hole = |x: &usize| rows.clone().any(|y| !has_disparity(self.validity[(*x, y)]));
        for x in (0..width).filter(hole) {
            let [columns, _] = self.around((x, y));
            plain[columns].fill(false);
        }
        let (first, second) = out.split_at_mut(2 * width);
        between_row(self.low, (own, above), sums, first);
        between_row(self.low, (own, below), sums, second);
    }

    /// How far the disparity at `place` of the full size, in the block of `own`, is above the smallest, and the pixel of half the size
    /// that it is most like.
    fn at_edge(
        &self,
        own: (usize, usize),
        [columns, rows]: &[Range<usize>; 2],
        place: (usize, usize),
        image: &Image,
    ) -> (i32, (usize, usize)) {
        if !has_disparity(self.validity[own]) {
            return (self.above_low[own], own);
        }
        let colour = image.pixels[place];
        let mut near = [((0, 0), 0, 0); 9];
        let mut count = 0;
        for at in rows.clone().flat_map(|y| columns.clone().map(move |x| (x, y))) {
            if has_disparity(self.validity[at]) {
                near[count] = (at, self.above_low[at], unlike(self.colours[at], at, colour, place));
                count += 1;
            }
        }
        let near = &near[..count];
        let (least, most) =
            near.iter().fold((i32::MAX, i32::MIN), |(a, b), one| (a.min(one.1), b.max(one.1)));
        if most - least <= FRACTION {
            return (self.between(own, place), own);
        }
        let mut best = near[0];
        for &one in &near[1..] {
            if one.2 < best.2 {
                best = one;
            }
        }
        let (mut sum, mut weights) = (0, 0);
        for &(_, disparity, unlike) in near.iter().filter(|one| (one.1 - best.1).abs() <= FRACTION) {
            let weight = (NEAR + best.2 - unlike).max(0);
            sum += weight * (disparity - best.1);
            weights += weight;
        }
        (best.1 + sum / weights, best.0)
    }

    /// That at `place` between the four nearest pixels, of which that of its block is `own`.
    fn between(&self, own: (usize, usize), place: (usize, usize)) -> i32 {
        let (width, height) = self.above_low.size();
        let beside = |own: usize, place: usize, end: usize| {
            if place.is_multiple_of(2) { own.saturating_sub(1) } else { (own + 1).min(end - 1) }
        };
        let (x, y) = (beside(own.0, place.0, width), beside(own.1, place.1, height));
        let value = |at| self.above_low[if has_disparity(self.validity[at]) { at } else { own }];
        (9 * value(own) + 3 * value((x, own.1)) + 3 * value((own.0, y)) + value((x, y)) + 8) >> 4
    }
}

/// How unlike a pixel of half the size is to one of the full size.
fn unlike(half: Pixel, at: (usize, usize), full: Pixel, place: (usize, usize)) -> i32 {
    let colours: i32 = (0..3).map(|c| (i32::from(half[c] >> 8) - i32::from(full[c] >> 8)).abs()).sum();
    let halves = |at: usize, place: usize| (4 * at + 1).abs_diff(2 * place) as i32;
    colours + AWAY * (halves(at.0, place.0) + halves(at.1, place.1)) / 2
}

/// Where the disparities of 3 x 3 pixels span at most a pixel of the full size.
#[pulp::with_simd(flat_row = pulp::Arch::new())]
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

/// A row of the full size, between the row of half the size that it is in and the one beside that.
#[pulp::with_simd(between_row = pulp::Arch::new())]
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
