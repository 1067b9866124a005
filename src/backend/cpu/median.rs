//! Weighted median of the disparities: see [`crate::backend::Stage::Median`].

use super::Finest;
use crate::graph::colour_distance;
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
    let mut out = disparity.clone();
    out.data_mut().par_chunks_mut(width).enumerate().for_each_init(
        || (Vec::<i32>::new(), Vec::<u32>::new()),
        |(values, weight), (y, row)| {
            for (x, out) in row.iter_mut().enumerate() {
                if !touched(flags[(x, y)]) {
                    continue;
                }
                values.clear();
                weight.clear();
                let (mut low, mut high, mut total) = (*out, *out, 0);
                let centre = &guide.pixels[(x, y)];
                for ny in y.saturating_sub(radius)..(y + radius + 1).min(height) {
                    for nx in x.saturating_sub(radius)..(x + radius + 1).min(width) {
                        if !has_disparity(flags[(nx, ny)]) {
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
    *disparity = out;
}
