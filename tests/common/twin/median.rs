use super::Finest;
use super::fill::invalid;
use super::graph::colour_distance;
use mrfgs::image::{Pair, Plane};
use mrfgs::maps::flag;
use mrfgs::options::Median;
use mrfgs::plan::Plan;

/// Integer weight of a pixel at (dx, dy) whose squared colour difference is `distance`.
pub fn weight(dx: i64, dy: i64, distance: i64, sigma_space: f64, sigma_range: f64) -> i64 {
    let round = |e: f64| (1024.0 * (-e).exp()).round() as i64;
    let space = round((dx * dx + dy * dy) as f64 / (2.0 * sigma_space * sigma_space));
    // The colour difference counts in steps of the smallest power of two, at most 2^26, of which 1024 reach beyond 8
    // times twice the variance.
    let twice_variance = 2.0 * (sigma_range * 4080.0) * (sigma_range * 4080.0);
    let step = (0..=26).map(|k| 1i64 << k).find(|&s| s as f64 * 1024.0 > 8.0 * twice_variance);
    let step = step.unwrap_or(1 << 26);
    let range =
        if distance / step < 1024 { round((distance / step * step) as f64 / twice_variance) } else { 0 };
    space * range / 1024
}

/// Weighted median: sort the window, and take the first value at which half of the weight is reached.
pub fn median(plan: &Plan, pair: &Pair, maps: &mut Finest) {
    let (width, height) = plan.size();
    let method = &plan.method;
    let (sigma_space, sigma_range) = (method.median_sigma_space, method.median_sigma_range);
    let radius = i64::from(method.median_window / 2);
    let guide = pair.left();
    let Finest { disparity, validity, .. } = &*maps;
    let filled = |x: usize, y: usize| validity[(x, y)] & i32::from(flag::FILLED) != 0;
    let known = |x: usize, y: usize| !invalid(validity[(x, y)]) || filled(x, y);
    let touched = |x: usize, y: usize| match method.median {
        Median::Off => false,
        Median::Filled => filled(x, y),
        Median::All => known(x, y),
    };
    maps.disparity = Plane::from_fn(width, height, |x, y| {
        if !touched(x, y) {
            return disparity[(x, y)];
        }
        let mut values = Vec::new();
        for dy in -radius..=radius {
            for dx in -radius..=radius {
                let (nx, ny) = (x as i64 + dx, y as i64 + dy);
                if nx < 0 || ny < 0 || nx >= width as i64 || ny >= height as i64 {
                    continue;
                }
                let at = (nx as usize, ny as usize);
                if known(at.0, at.1) {
                    let distance = colour_distance(guide.pixels[(x, y)], guide.pixels[at]);
                    values.push((disparity[at], weight(dx, dy, distance, sigma_space, sigma_range)));
                }
            }
        }
        values.sort_unstable();
        let total: i64 = values.iter().map(|v| v.1).sum();
        let mut cumulated = 0;
        for (value, weight) in values {
            cumulated += weight;
            if cumulated * 2 >= total {
                return value;
            }
        }
        unreachable!("the centre has weight")
    });
}
