//! How well the images agree with a prior.
//!
//! At samples of the known pixels, the match at the known disparity is compared with matches at other disparities of the range. A right
//! prior has the best match of all at many samples, a wrong one hardly ever. Samples count by how much their matches differ,
//! because those of plain surfaces say nothing.

use crate::image::{Image, Pair};
use crate::maps::FRACTION;
use crate::options::DisparityRange;
use crate::prior::Prior;
use crate::threads::prelude::*;

/// The largest number of samples.
const SAMPLES: usize = 4096;
/// With fewer samples, the prior is trusted.
const FEW: usize = 16;
/// Number of other disparities per sample.
const OTHERS: i32 = 16;
/// Largest difference of matches that counts, in 1/256 levels summed over a window: 32 levels per pixel.
const DIFFER_MOST: u32 = 25 * 32 * 256;
/// Radius of the windows that are compared, in px.
const RADIUS: i32 = 2;
/// Largest tolerance of a disparity, in px.
const MOST_TOLERANCE: i32 = 8;
/// Share of samples whose match is the best, in 1/256, from which on a prior is trusted fully, and up to which not at all.
const SHARES: [u64; 2] = [90, 45];

/// The weight of `known` for `pair`, matched over `range`, in 1/256.
pub(super) fn weight(known: &Prior, pair: &Pair, range: DisparityRange) -> u32 {
    let all = known.count();
    let every = all.div_ceil(SAMPLES).max(1);
    let samples: Vec<_> = known.known().step_by(every).collect();
    let found: Vec<_> = samples.par_iter().filter_map(|&sample| compared(sample, pair, range)).collect();
    let says: u64 = found.iter().map(|(says, _)| says).sum();
    let best: u64 = found.iter().filter(|(_, is_best)| *is_best).map(|(says, _)| says).sum();
    if found.len() < FEW || says == 0 {
        return 256;
    }
    let [full, none] = SHARES;
    (256 * (256 * best / says).saturating_sub(none).min(full - none) / (full - none)) as u32
}

/// How much the matches of a known pixel differ, squared, and whether that at its disparity is the best.
fn compared(
    ((x, y), disparity, sigma): ((usize, usize), i32, u16),
    pair: &Pair,
    range: DisparityRange,
) -> Option<(u64, bool)> {
    let own = (disparity + FRACTION / 2).div_euclid(FRACTION);
    let tolerance = (1 + i32::from(sigma) / FRACTION).min(MOST_TOLERANCE);
    let around = |d: i32| d - tolerance..=d + tolerance;
    let cost = |d: i32| around(d).filter_map(|d| unlikeness(pair, (x as i32, y as i32), d)).min();
    let own_cost = cost(own)?;
    let span = range.max - range.min;
    let others = (0..OTHERS).map(|i| range.min + span * i / (OTHERS - 1));
    let far = others.filter(|d| (d - own).abs() > 2 * tolerance).filter_map(cost);
    let (least, most) = far.fold((u32::MAX, 0), |(least, most), cost| (least.min(cost), most.max(cost)));
    let says = u64::from((most.max(own_cost).checked_sub(least.min(own_cost))?).min(DIFFER_MOST) / 256);
    (most > 0).then_some((says * says, own_cost < least))
}

/// The sum of absolute differences of the windows around a left pixel and its match at disparity `d`, each less its mean; `None`
/// where the windows are not inside the views.
fn unlikeness(pair: &Pair, (x, y): (i32, i32), d: i32) -> Option<u32> {
    let left = window(pair.left(), (x, y))?;
    let right = window(pair.right(), (x - d, y))?;
    Some(left.iter().zip(&right).map(|(a, b)| a.abs_diff(*b)).sum())
}

/// The grey values of the window around a pixel, less their mean, in 1/256 levels.
fn window(
    image: &Image,
    (x, y): (i32, i32),
) -> Option<[i32; ((2 * RADIUS + 1) * (2 * RADIUS + 1)) as usize]> {
    let (width, height) = (image.width() as i32, image.height() as i32);
    if x < RADIUS || y < RADIUS || x + RADIUS >= width || y + RADIUS >= height {
        return None;
    }
    let side = 2 * RADIUS + 1;
    let mut values = [0; ((2 * RADIUS + 1) * (2 * RADIUS + 1)) as usize];
    for (i, value) in (0..).zip(&mut values) {
        let at = ((x - RADIUS + i % side) as usize, (y - RADIUS + i / side) as usize);
        if image.masked[at] {
            return None;
        }
        *value = image.pixels[at][3].into();
    }
    let mean = values.iter().sum::<i32>() / values.len() as i32;
    Some(values.map(|value| value - mean))
}
