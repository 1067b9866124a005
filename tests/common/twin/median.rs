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
    let sigma_range = plan.method.median_sigma_range;
    smooth(plan, pair, maps, 1, sigma_range, |validity| match plan.method.median {
        Median::Off => false,
        Median::Filled => filled(validity),
        Median::All => known(validity),
    });
}

/// The same of filled pixels, the window's places four pixels apart.
pub fn fill_median(plan: &Plan, pair: &Pair, maps: &mut Finest) {
    smooth(plan, pair, maps, 4, plan.method.median_sigma_range / 2.0, filled);
}

fn filled(validity: i32) -> bool {
    validity & i32::from(flag::FILLED) != 0
}

fn known(validity: i32) -> bool {
    !invalid(validity) || filled(validity)
}

fn smooth(
    plan: &Plan,
    pair: &Pair,
    maps: &mut Finest,
    step: i64,
    sigma_range: f64,
    touched: impl Fn(i32) -> bool,
) {
    let (width, height) = plan.size();
    let method = &plan.method;
    let sigma_space = method.median_sigma_space;
    let radius = i64::from(method.median_window / 2);
    let guide = pair.left();
    let Finest { disparity, validity, .. } = &*maps;
    maps.disparity = Plane::from_fn(width, height, |x, y| {
        if !touched(validity[(x, y)]) {
            return disparity[(x, y)];
        }
        let mut values = Vec::new();
        for j in -radius..=radius {
            for i in -radius..=radius {
                let (nx, ny) = (x as i64 + step * i, y as i64 + step * j);
                if nx < 0 || ny < 0 || nx >= width as i64 || ny >= height as i64 {
                    continue;
                }
                let at = (nx as usize, ny as usize);
                if known(validity[at]) {
                    let distance = colour_distance(guide.pixels[(x, y)], guide.pixels[at]);
                    values.push((disparity[at], weight(i, j, distance, sigma_space, sigma_range)));
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
