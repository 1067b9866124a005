//! Weighted median of the disparities: see [`crate::backend::Stage::Median`].

use super::Finest;
use crate::image::Image;
use crate::maps::{flag, has_disparity};
use crate::options::Median;
use crate::plan::Plan;
use crate::tables::MedianWeights;
use rayon::prelude::*;

pub(super) fn run(plan: &Plan, guide: &Image, maps: &mut Finest) {
    let method = &plan.method;
    let weights = MedianWeights::of(method);
    let radius = weights.radius();
    let touched = |f: u8| {
        has_disparity(f)
            && match method.median {
                Median::Off => false,
                Median::Filled => f & flag::FILLED != 0,
                Median::All => true,
            }
    };
    let Finest { disparity, validity: flags, .. } = maps;
    let (width, height) = disparity.size();
    // Channel by channel, so that rows of the window are vectors.
    let channels = [0, 1, 2].map(|c| guide.pixels.map(|pixel| pixel[c]));
    let known = flags.map(|&f| if has_disparity(f) { u32::MAX } else { 0 });
    let mut out = disparity.clone();
    out.data_mut().par_chunks_mut(width).enumerate().for_each_init(
        || Window::new(radius),
        |window, (y, row)| {
            for (x, out) in row.iter_mut().enumerate() {
                if !touched(flags[(x, y)]) {
                    continue;
                }
                window.clear();
                let columns = x.saturating_sub(radius)..(x + radius + 1).min(width);
                let centre = channels.each_ref().map(|channel| channel[(x, y)]);
                for ny in y.saturating_sub(radius)..(y + radius + 1).min(height) {
                    let space =
                        &weights.space_row(ny.abs_diff(y))[columns.start + radius - x..][..columns.len()];
                    let guide = channels.each_ref().map(|channel| &channel.row(ny)[columns.clone()]);
                    let (values, known) =
                        (&disparity.row(ny)[columns.clone()], &known.row(ny)[columns.clone()]);
                    window.add(&weights, space, centre, guide, values, known);
                }
                *out = window.median(*out);
            }
        },
    );
    *disparity = out;
}

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

    /// The smallest value at which half of the weight is reached, `centre` being one of them.
    fn median(&self, centre: i32) -> i32 {
        let weighted = || self.values.iter().zip(&self.weights);
        let total: u32 = self.weights.iter().sum();
        let of = |value: i32, weight: u32| if weight > 0 { value } else { centre };
        let mut low = weighted().map(|(&v, &w)| of(v, w)).min().unwrap_or(centre);
        let mut high = weighted().map(|(&v, &w)| of(v, w)).max().unwrap_or(centre);
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
