//! Conditions a pair: reduces differences between the views that rigs, lenses and noise cause, before they are matched.
//!
//! Three faults are common in rectified pairs, and each costs more than any part of a matcher gains: the rows of the views
//! are offset by a fraction of a row, one view is blurred more than the other, or both are noisy or strongly compressed.
//! They are measured on the whole image, and corrected by filters. A pair without them stays the same, bit for bit.

mod compression;
mod noise;
mod rows;
mod sharpness;

use super::filter::{moved, smoothed};
use crate::image::{Image, Pair};
use crate::maps::FRACTION;
use crate::options::{DisparityRange, FrontOptions};
use crate::threads::prelude::join;
use std::fmt;

/// The corrections that are made to a pair.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Conditioning {
    /// The offset of the right view below the left one, in 1/256 px, by which it is moved up.
    pub offset: i32,
    /// Standard deviations of the Gaussians that smooth the left and the right view, in pixels; 0 for none.
    pub smoothing: [f64; 2],
}

/// Corrects the faults of `pair` that `options` name, and returns the corrections. Its disparities are in
/// `range`. A view that does not change is shared.
#[must_use]
pub fn condition(pair: &Pair, range: DisparityRange, options: &FrontOptions) -> (Pair, Conditioning) {
    let mut found = Conditioning::default();
    let halves = pair.map(Image::downsampled);
    let unlike = || if options.equal_sharpness { sharpness::smoothing(pair, &halves) } else { [0.0; 2] };
    let needs_matches = options.level_rows || options.denoise;
    let matches_of = |halves: &Pair| if needs_matches { rows::matches(halves, range) } else { Vec::new() };
    // Halving removes the blocks of JPEG.
    let looks_for_blocks = options.denoise && pair.full().is_none();
    let blocks = || if looks_for_blocks { compression::smoothing(pair) } else { 0.0 };
    // Each task is too short for many threads, so they run in parallel.
    let (blocks, (unlike, mut matches)) = join(blocks, || join(unlike, || matches_of(&halves)));
    found.smoothing = unlike;
    if found != Conditioning::default() {
        matches = matches_of(&found.apply(pair).map(Image::downsampled));
    }
    if options.level_rows {
        found.offset = rows::offset(&matches);
        if found.offset != 0 {
            // Measured offsets are biased towards whole rows. What remains is smaller, and so is its bias.
            matches = rows::matches(&found.apply(pair).map(Image::downsampled), range);
            found.offset += rows::median_offset(&matches);
        }
    }
    let level = found.apply(pair);
    let sigma = if options.denoise { f64::max(noise::smoothing(&level, &matches), blocks) } else { 0.0 };
    if sigma == 0.0 {
        return (level, found);
    }
    found.smoothing = found.smoothing.map(|of_view| (of_view * of_view + sigma * sigma).sqrt());
    (found.apply(pair), found)
}

impl Conditioning {
    /// The median of each of the corrections that were `measured` in several parts of a pair, or on several frames of the same cameras;
    /// none without a measurement.
    #[must_use]
    pub fn median(measured: &[Self]) -> Self {
        let middle = measured.len() / 2;
        let of = |value: &dyn Fn(&Self) -> f64| {
            let mut values: Vec<f64> = measured.iter().map(value).collect();
            values.sort_by(f64::total_cmp);
            values.get(middle).copied().unwrap_or_default()
        };
        Self {
            offset: of(&|one| f64::from(one.offset)) as i32,
            smoothing: [0, 1].map(|view| of(&|one| one.smoothing[view])),
        }
    }

    /// The same corrections for a pair at twice the size.
    pub(super) fn doubled(&self) -> Self {
        Self { offset: 2 * self.offset, smoothing: self.smoothing.map(|sigma| 2.0 * sigma) }
    }

    /// Halves the corrections, for the pair at half its size.
    pub(super) fn halved(&self) -> Self {
        Self { offset: self.offset / 2, smoothing: self.smoothing.map(|sigma| sigma / 2.0) }
    }

    /// Applies the corrections.
    pub(super) fn apply(&self, pair: &Pair) -> Pair {
        let level =
            if self.offset == 0 { pair.clone() } else { pair.with_right(moved(pair.right(), self.offset)) };
        let [left, right] = self.smoothing;
        let level = if left == 0.0 { level } else { level.with_left(smoothed(level.left(), left)) };
        if right == 0.0 { level } else { level.with_right(smoothed(level.right(), right)) }
    }
}

/// Describes the corrections; empty if there are none.
impl fmt::Display for Conditioning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rows = f64::from(self.offset.abs()) / f64::from(FRACTION);
        let way = if self.offset > 0 { "up" } else { "down" };
        let moved = (self.offset != 0).then(|| format!("the right view is moved {way} by {rows:.2} px"));
        let [left, right] = self.smoothing;
        let smoothed = |what: &str, sigma: f64| Some(format!("{what} smoothed by {sigma:.2} px"));
        let smoothed = match (left > 0.0, right > 0.0) {
            (false, false) => None,
            (true, false) => smoothed("the left view is", left),
            (false, true) => smoothed("the right view is", right),
            (true, true) if left.total_cmp(&right).is_eq() => smoothed("both views are", left),
            (true, true) => Some(format!("the views are smoothed by {left:.2} and {right:.2} px")),
        };
        f.write_str(&moved.into_iter().chain(smoothed).collect::<Vec<_>>().join(", "))
    }
}
