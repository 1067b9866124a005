use super::flag;
use crate::graph::colour_distance;
use crate::image::{Image, Plane};
use crate::tables::exp_neg;
use rayon::prelude::*;

/// Entries of the range table; differences beyond it weigh nothing.
const RANGE_ENTRIES: usize = 1024;
/// Bits of each of the two weights that are multiplied.
const WEIGHT_BITS: u32 = 10;

/// Integer weights of the bilateral window: the product of a spatial weight and a range weight, each round(1024
/// exp(-e)), shifted right by 10. For the range weight, the squared colour difference in sixteenths of an 8-bit level
/// is rounded down to whole steps of 2^k, the smallest (up to 2^26) of which 1024 exceed 16 variances; a difference of
/// 1024 steps or more weighs nothing.
#[derive(Clone, Debug)]
pub struct MedianWeights {
    radius: usize,
    /// By |dx| and |dy|, \[dy\]\[dx\].
    space: Vec<u32>,
    /// By squared colour difference, in steps of 2^shift.
    range: Vec<u32>,
    shift: u32,
}

impl MedianWeights {
    /// Weights for a window of `window` pixels, sigmas in pixels and in the intensity range 0 to 1.
    #[must_use]
    pub fn new(window: usize, sigma_space: f64, sigma_range: f64) -> Self {
        let radius = window / 2;
        let weight = |e: f64| (f64::from(1 << WEIGHT_BITS) * exp_neg(e) + 0.5).floor() as u32;
        let space = (0..=radius)
            .flat_map(|dy| (0..=radius).map(move |dx| (dx * dx + dy * dy) as f64))
            .map(|d| weight(d / (2.0 * sigma_space * sigma_space)))
            .collect();
        // In squared sixteenths of an 8-bit level; exp(-8) is below half a unit of weight.
        let twice_variance = 2.0 * (sigma_range * 4080.0) * (sigma_range * 4080.0);
        let mut shift = 0;
        while f64::from(1u32 << shift) * RANGE_ENTRIES as f64 <= 8.0 * twice_variance && shift < 26 {
            shift += 1;
        }
        let range = (0..RANGE_ENTRIES)
            .map(|i| weight(i as f64 * f64::from(1u32 << shift) / twice_variance))
            .collect();
        Self { radius, space, range, shift }
    }

    /// Radius of the window in pixels.
    #[must_use]
    pub fn radius(&self) -> usize {
        self.radius
    }

    /// Weight of a pixel |dx|, |dy| away whose squared colour difference is `distance`.
    #[must_use]
    pub fn weight(&self, dx: usize, dy: usize, distance: u32) -> u32 {
        let range = self.range.get((distance >> self.shift) as usize).copied().unwrap_or(0);
        (self.space[dy * (self.radius + 1) + dx] * range) >> WEIGHT_BITS
    }
}

/// Weighted median of the pixels for which `touch` says so, over the pixels that have a disparity: the smallest value
/// at which half of the weight in the window is reached. `flags` say which pixels have one.
#[must_use]
pub fn weighted_median(
    disparity: &Plane<i32>,
    flags: &Plane<u8>,
    guide: &Image,
    weights: &MedianWeights,
    touch: impl Fn(u8) -> bool + Sync,
) -> Plane<i32> {
    let (width, height) = disparity.size();
    let known = |f: u8| f & flag::INVALID == 0 || f & flag::FILLED != 0;
    let mut out = disparity.clone();
    out.data_mut().par_chunks_mut(width).enumerate().for_each_init(
        || (Vec::<i32>::new(), Vec::<u32>::new()),
        |(values, weight), (y, row)| {
            for (x, out) in row.iter_mut().enumerate() {
                let flags_here = flags[(x, y)];
                if !known(flags_here) || !touch(flags_here) {
                    continue;
                }
                values.clear();
                weight.clear();
                let (mut low, mut high, mut total) = (*out, *out, 0);
                let centre = &guide.pixels[(x, y)];
                for ny in y.saturating_sub(weights.radius)..(y + weights.radius + 1).min(height) {
                    for nx in x.saturating_sub(weights.radius)..(x + weights.radius + 1).min(width) {
                        if !known(flags[(nx, ny)]) {
                            continue;
                        }
                        let distance = colour_distance(centre, &guide.pixels[(nx, ny)]);
                        let w = weights.weight(nx.abs_diff(x), ny.abs_diff(y), distance);
                        let value = disparity[(nx, ny)];
                        (low, high) = (low.min(value), high.max(value));
                        total += w;
                        values.push(value);
                        weight.push(w);
                    }
                }
                // Bisection needs no sort: the smallest value whose cumulated weight reaches half.
                while low < high {
                    let middle = low + (high - low) / 2;
                    let below: u32 = values
                        .iter()
                        .zip(weight.iter())
                        .map(|(&v, &w)| if v <= middle { w } else { 0 })
                        .sum();
                    if 2 * below >= total {
                        high = middle;
                    } else {
                        low = middle + 1;
                    }
                }
                *out = low;
            }
        },
    );
    out
}
