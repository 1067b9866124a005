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
const FEW: u64 = 16;
/// Number of other disparities per sample.
const OTHERS: i32 = 16;
/// Largest difference of matches that counts, in 1/256 levels summed over a window: 32 levels per pixel.
const DIFFER_MOST: u32 = 25 * 32 * 256;
/// Radius of the windows that are compared, in px.
const RADIUS: i32 = 2;
/// Largest tolerance of a disparity, in px.
const MOST_TOLERANCE: i32 = 8;
/// Share of samples whose match is the best, in 1/256, from which on a prior is trusted fully, and up to which not at all.
const SHARES: [u64; 2] = [100, 50];
/// A prior with a smaller mean trust is wrong as a whole, in 1/256.
const LEAST_TRUST: u64 = 128;
/// Number of blocks along the longer side of a view, and their least side in px.
const BLOCKS: usize = 10;
const LEAST_SIDE: usize = 32;
/// The share of the whole view counts in each block like this many samples.
const SHARED_SAMPLES: u64 = 6;

/// Sums over samples of squared differences of matches: of all samples, and of those whose best match is at the known disparity.
#[derive(Clone, Copy, Default)]
struct Votes {
    says: u64,
    best: u64,
    samples: u64,
}

impl Votes {
    fn add(&mut self, other: Self) {
        self.says += other.says;
        self.best += other.best;
        self.samples += other.samples;
    }
}

/// Drops what the images contradict in `known`, and divides standard deviations by the trust where it is less than full. Trust is found
/// for blocks of the view, each with those around it, because a prior may be wrong in part. Returns the mean trust, in 1/256. At less than
/// a half, the whole prior is dropped.
pub(super) fn weighed(known: &Prior, pair: &Pair, range: DisparityRange) -> (Prior, u32) {
    let (width, height) = known.size();
    let side = width.max(height).div_ceil(BLOCKS).max(LEAST_SIDE);
    let (columns, rows) = (width.div_ceil(side), height.div_ceil(side));
    let all = known.count();
    let every = all.div_ceil(SAMPLES).max(1);
    let samples: Vec<_> = known.known().step_by(every).collect();
    let found: Vec<_> = samples.par_iter().map(|&sample| compared(sample, pair, range)).collect();
    let mut blocks = vec![Votes::default(); columns * rows];
    let mut whole = Votes::default();
    for (((x, y), ..), votes) in samples.iter().zip(found) {
        if let Some(votes) = votes {
            blocks[y / side * columns + x / side].add(votes);
            whole.add(votes);
        }
    }
    if whole.samples < FEW || whole.says == 0 {
        return (known.clone(), 256);
    }
    let trust = |column: usize, row: usize| {
        let says = SHARED_SAMPLES * whole.says / whole.samples;
        let best = SHARED_SAMPLES * whole.best / whole.samples;
        let mut votes = Votes { says, best, samples: 0 };
        for v in row.saturating_sub(1)..(row + 2).min(rows) {
            for u in column.saturating_sub(1)..(column + 2).min(columns) {
                votes.add(blocks[v * columns + u]);
            }
        }
        let [full, none] = SHARES;
        256 * (256 * votes.best / votes.says.max(1)).saturating_sub(none).min(full - none) / (full - none)
    };
    let trusts: Vec<u64> = (0..columns * rows).map(|i| trust(i % columns, i / columns)).collect();
    let (mut weighed, mut sum) = (known.clone(), 0);
    for ((x, y), _, sigma) in known.known() {
        let trust = trusts[y / side * columns + x / side];
        sum += trust;
        let less = (u64::from(sigma) * 256).checked_div(trust).unwrap_or(0);
        weighed.sigma[(x, y)] = less.min(u16::MAX.into()) as u16;
    }
    let mean = sum / all.max(1) as u64;
    // On plain surfaces even a prior of little weight would win.
    if mean < LEAST_TRUST {
        return (Prior::nothing(known.kind, known.size()), 0);
    }
    (weighed, mean as u32)
}

/// Compares the matches of a known pixel. `None` if its windows leave the views.
fn compared(
    ((x, y), disparity, sigma): ((usize, usize), i32, u16),
    pair: &Pair,
    range: DisparityRange,
) -> Option<Votes> {
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
    let best = if own_cost < least { says * says } else { 0 };
    (most > 0).then_some(Votes { says: says * says, best, samples: 1 })
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
