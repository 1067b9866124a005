//! Noise: the finest detail that the two views do not share, because of their sensors or of compression.

use super::rows::MIN_MATCHES;
use crate::front::matches::SparseMatch;
use crate::image::{Image, Pair};
use crate::maps::FRACTION;
use crate::threads::prelude::*;
use std::array::from_fn;

/// Pairs of shared detail and a standard deviation in pixels: if the views share less of their finest detail,
/// both are smoothed by that (open). Of 49 real pairs 37 share 0.7 or more, and all but one 0.57. Of eight
/// clean pairs, noise of 5 levels takes two below 0.7, noise of 10 all eight, and noise of 20 all below 0.5.
const SMOOTHING: [(f64, f64); 3] = [(0.5, 1.0), (0.57, 0.7), (0.7, 0.5)];
/// Radius of the patches that are compared, in pixels.
const RADIUS: usize = 4;
const SIDE: usize = 2 * RADIUS + 1;
const PIXELS: usize = SIDE * SIDE;
/// The search radius for patches of the right view around their expected position, in pixels.
const REACH: i32 = 3;
/// Patches are compared if their disparity is this close to a whole number, in pixels, because interpolation smooths.
const NEARLY_WHOLE: f64 = 0.2;
/// Detail is clamped to this many times its median, because smoothing would spread single wrong pixels.
const MAX_DETAIL: i32 = 2;

/// The standard deviation by which to smooth both views, from matches at half their size; 0 for none.
pub(super) fn smoothing(pair: &Pair, matches: &[SparseMatch]) -> f64 {
    let shared = shared_detail(pair, matches);
    let smoothing = SMOOTHING.iter().find(|(least, _)| shared.is_some_and(|shared| shared < *least));
    smoothing.map_or(0.0, |(_, sigma)| *sigma)
}

/// The correlation of the finest detail over all patches; `None` if there are too few.
fn shared_detail(pair: &Pair, matches: &[SparseMatch]) -> Option<f64> {
    let patches: Vec<_> = matches.par_iter().filter_map(|m| details(pair, m)).collect();
    if patches.len() < MIN_MATCHES {
        return None;
    }
    let all = |side: usize| patches.iter().flat_map(move |details| &details[side]);
    Some(correlation(all(0), all(1)))
}

/// The finest detail around a match in the left and the right view, if its disparity is nearly a whole number of pixels.
fn details(pair: &Pair, m: &SparseMatch) -> Option<[[i32; PIXELS]; 2]> {
    let (x, y) = (2 * m.x, 2 * m.y);
    let left = Patch::new(pair.left(), x, y)?;
    let expected = x as i32 - (2 * m.disparity + FRACTION / 2).div_euclid(FRACTION);
    let there = |x: i32| Patch::new(pair.right(), usize::try_from(x).ok()?, y);
    let places: Vec<Patch> = (expected - REACH..=expected + REACH).map(there).collect::<Option<_>>()?;
    let scores: Vec<f64> = places.iter().map(|right| correlation(&left.coarse, &right.coarse)).collect();
    let best = (1..scores.len() - 1).max_by(|a, b| scores[*a].total_cmp(&scores[*b]))?;
    let (before, peak, after) = (scores[best - 1], scores[best], scores[best + 1]);
    let bend = before - 2.0 * peak + after;
    if bend >= 0.0 || (before - after).abs() > -2.0 * bend * NEARLY_WHOLE {
        return None;
    }
    let mut details = [left.fine(), places[best].fine()];
    let mut sizes: Vec<i32> = details.iter().flatten().map(|v| v.abs()).collect();
    let median = *sizes.select_nth_unstable(PIXELS).1;
    details.iter_mut().flatten().for_each(|v| *v = (*v).clamp(-MAX_DETAIL * median, MAX_DETAIL * median));
    Some(details)
}

/// The sum of products over the root of the product of the sums of squares; 1 where a sum is 0.
fn correlation<'a>(a: impl IntoIterator<Item = &'a i32>, b: impl IntoIterator<Item = &'a i32>) -> f64 {
    let (mut aa, mut ab, mut bb) = (0, 0, 0);
    for (&a, &b) in a.into_iter().zip(b) {
        let (a, b) = (i64::from(a), i64::from(b));
        (aa, ab, bb) = (aa + a * a, ab + a * b, bb + b * b);
    }
    if aa == 0 || bb == 0 { 1.0 } else { ab as f64 / (aa as f64).sqrt() / (bb as f64).sqrt() }
}

/// The grey around a pixel, in 1/16 of an 8-bit level.
struct Patch {
    grey: [[i32; SIDE + 2]; SIDE + 2],
    /// Smoothed by a binomial filter of 3 x 3 pixels, times 16, less the mean.
    coarse: [i32; PIXELS],
    mean: i32,
}

impl Patch {
    /// `None` if the patch leaves the image or contains a masked pixel.
    fn new(image: &Image, x: usize, y: usize) -> Option<Self> {
        const AROUND: usize = RADIUS + 1;
        let (width, height) = image.pixels.size();
        let (left, top) = (x.checked_sub(AROUND)?, y.checked_sub(AROUND)?);
        if x + AROUND >= width || y + AROUND >= height {
            return None;
        }
        let mut grey = [[0; SIDE + 2]; SIDE + 2];
        for (j, row) in grey.iter_mut().enumerate() {
            let columns = left..left + SIDE + 2;
            if image.masked.row(top + j)[columns.clone()].contains(&true) {
                return None;
            }
            let pixels = &image.pixels.row(top + j)[columns];
            row.iter_mut().zip(pixels).for_each(|(grey, pixel)| *grey = i32::from(pixel[3] >> 4));
        }
        let across: [[i32; SIDE]; SIDE + 2] =
            from_fn(|y| from_fn(|x| grey[y][x] + 2 * grey[y][x + 1] + grey[y][x + 2]));
        let sums: [i32; PIXELS] = from_fn(|at| {
            let (x, y) = (at % SIDE, at / SIDE);
            across[y][x] + 2 * across[y + 1][x] + across[y + 2][x]
        });
        let mean = sums.iter().sum::<i32>() / PIXELS as i32;
        Some(Self { grey, coarse: sums.map(|sum| sum - mean), mean })
    }

    /// The detail that the filter removes.
    fn fine(&self) -> [i32; PIXELS] {
        from_fn(|at| self.grey[at / SIDE + 1][at % SIDE + 1] - (self.coarse[at] + self.mean) / 16)
    }
}
