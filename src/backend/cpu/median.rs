//! Weighted medians of the disparities: see [`crate::backend::Stage::Median`] and
//! [`crate::backend::Stage::FillMedian`].

use super::Finest;
use crate::image::{Image, Plane};
use crate::maps::{flag, has_disparity};
use crate::options::Median;
use crate::plan::Plan;
use crate::tables::MedianWeights;
use rayon::prelude::*;

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
    let (radius, step) = (weights.radius(), 1 << weights.step_bits());
    let Finest { disparity, validity: flags, .. } = maps;
    let (width, height) = disparity.size();
    // Columns a step apart side by side, and channel by channel, so that rows of the window are vectors.
    let columns: Vec<usize> = (0..step).flat_map(|phase| (phase..width).step_by(step)).collect();
    let channels = [0, 1, 2].map(|c| Plane::from_fn(width, height, |x, y| guide.pixels[(columns[x], y)][c]));
    let mask = |f: u8| if has_disparity(f) { u32::MAX } else { 0 };
    let known = Plane::from_fn(width, height, |x, y| mask(flags[(columns[x], y)]));
    let values = Plane::from_fn(width, height, |x, y| disparity[(columns[x], y)]);
    let mut out = disparity.clone();
    out.data_mut().par_chunks_mut(width).enumerate().for_each_init(
        || Window::new(radius),
        |window, (y, row)| {
            let mut end = 0;
            for phase in 0..step.min(width) {
                let start = end;
                end += (width - phase).div_ceil(step);
                for (at, &x) in (start..end).zip(&columns[start..end]) {
                    if !touched(flags[(x, y)]) {
                        continue;
                    }
                    window.clear();
                    let seen = at.saturating_sub(radius).max(start)..(at + radius + 1).min(end);
                    let centre = channels.each_ref().map(|channel| channel[(at, y)]);
                    let first = y - radius.min(y / step) * step;
                    for ny in (first..(y + radius * step + 1).min(height)).step_by(step) {
                        let space = &weights.space_row(ny.abs_diff(y) / step)[seen.start + radius - at..];
                        let guide = channels.each_ref().map(|channel| &channel.row(ny)[seen.clone()]);
                        let (values, known) = (&values.row(ny)[seen.clone()], &known.row(ny)[seen.clone()]);
                        window.add(weights, &space[..seen.len()], centre, guide, values, known);
                    }
                    row[x] = window.median(row[x]);
                }
            }
        },
    );
    *disparity = out;
}

/// How near to what it replaces a median mostly is, in 1/256 px.
const NEAR: i32 = 64;

/// Values and weights of a window. What has no disparity has no weight.
struct Window {
    values: Vec<i32>,
    weights: Vec<u32>,
    distances: Vec<u32>,
}

impl Window {
    fn new(radius: usize) -> Self {
        let side = 2 * radius + 1;
        let pixels = side * side;
        Self {
            values: Vec::with_capacity(pixels),
            weights: Vec::with_capacity(pixels),
            distances: vec![0; side],
        }
    }

    fn clear(&mut self) {
        self.values.clear();
        self.weights.clear();
    }

    /// Adds a row of the window.
    fn add(
        &mut self,
        weights: &MedianWeights,
        space: &[u32],
        centre: [u16; 3],
        guide: [&[u16]; 3],
        values: &[i32],
        known: &[u32],
    ) {
        let distances = &mut self.distances[..values.len()];
        let [r, g, b] = guide;
        for (i, distance) in distances.iter_mut().enumerate() {
            // `graph::colour_distance`, channel by channel: a row at once is a vector.
            let squared = |a: u16, b: u16| (u32::from(a.abs_diff(b)) >> 4).pow(2);
            *distance = squared(r[i], centre[0]) + squared(g[i], centre[1]) + squared(b[i], centre[2]);
        }
        self.values.extend_from_slice(values);
        self.weights.extend(
            distances
                .iter()
                .zip(space)
                .zip(known)
                .map(|((&d, &space), &known)| weights.product(space, d) & known),
        );
    }

    /// The smallest value at which half of the weight is reached. It is sought near `guess` first.
    fn median(&self, guess: i32) -> i32 {
        let weighted = || self.values.iter().zip(&self.weights);
        let total: u32 = self.weights.iter().sum();
        let [mut low, mut high] = [guess - NEAR, guess + NEAR];
        let [below_low, below_high] = weighted().fold([0, 0], |[first, second], (&v, &w)| {
            [first + if v <= low { w } else { 0 }, second + if v <= high { w } else { 0 }]
        });
        if 2 * below_low >= total {
            (low, high) = (self.values.iter().copied().min().unwrap_or(guess), low);
        } else if 2 * below_high >= total {
            low += 1;
        } else {
            (low, high) = (high + 1, self.values.iter().copied().max().unwrap_or(guess));
        }
        // Bisection needs no sort.
        while low < high {
            let middle = low + (high - low) / 2;
            let below: u32 = weighted().map(|(&v, &w)| if v <= middle { w } else { 0 }).sum();
            if 2 * below >= total {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        low
    }
}
