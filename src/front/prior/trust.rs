//! How well the images agree with a prior.
//!
//! At samples of the known pixels, the match at the known disparity is compared with matches at other disparities of the range. Of a
//! wrong prior, half of the others match better. Of a right one few do. Samples count by how much their matches differ, because those of
//! plain surfaces say nothing.

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
/// Other disparities differ by more than this, in px.
const NEAR: i32 = 2;
/// Largest difference of matches that counts, in 1/256 levels summed over a window: 32 levels per pixel.
const DIFFER_MOST: u32 = 25 * 32 * 256;
/// Radius of the windows that are compared, in px.
const RADIUS: i32 = 2;
/// Share of better matches, in 1/256, up to which a prior is trusted fully, and from which on it is not trusted at all.
const SHARES: [u64; 2] = [80, 108];

/// The weight of `known` for `pair`, matched over `range`, in 1/256.
pub(super) fn weight(known: &Prior, pair: &Pair, range: DisparityRange) -> u32 {
    let all = known.count();
    let every = all.div_ceil(SAMPLES).max(1);
    let samples: Vec<_> = known.known().step_by(every).collect();
    let better = |&((x, y), disparity, _): &((usize, usize), i32, u16)| {
        let own = (disparity + FRACTION / 2).div_euclid(FRACTION);
        let cost = |d: i32| (d - 1..=d + 1).filter_map(|d| unlikeness(pair, (x as i32, y as i32), d)).min();
        let own_cost = cost(own)?;
        let span = range.max - range.min;
        let others =
            (0..OTHERS).map(|i| range.min + span * i / (OTHERS - 1)).filter(|d| (d - own).abs() > NEAR);
        let costs: Vec<u32> = others.filter_map(cost).collect();
        let least = costs.iter().copied().min()?.min(own_cost);
        let most = costs.iter().copied().max()?.max(own_cost);
        // Ties count half.
        let better: u64 =
            costs.iter().map(|&other| 2 * u64::from(other < own_cost) + u64::from(other == own_cost)).sum();
        let says = u64::from((most - least).min(DIFFER_MOST));
        Some((says * (better * 128 / costs.len() as u64), says))
    };
    let found: Vec<(u64, u64)> = samples.par_iter().filter_map(better).collect();
    let (better, says) = found.iter().fold((0, 0), |sum, sample| (sum.0 + sample.0, sum.1 + sample.1));
    if found.len() < FEW || says == 0 {
        return 256;
    }
    let [full, none] = SHARES;
    (256 * none.saturating_sub(better / says).min(none - full) / (none - full)) as u32
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
