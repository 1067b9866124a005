use super::Finest;
use super::fill::invalid;
use mrfgs::image::{Pair, Plane};
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::flag;
use mrfgs::options::Median;

/// Weight subtracted for the distance of a pixel at (dx, dy).
pub fn space(dx: i64, dy: i64, sigma_space: f64) -> i64 {
    let e = (dx * dx + dy * dy) as f64 / (2.0 * sigma_space * sigma_space);
    (96.0 * (1.0 - (-e).exp())).round() as i64
}

/// Weight subtracted for the difference of two colours.
pub fn colour(a: [u16; 4], b: [u16; 4], sigma_range: f64) -> i64 {
    // The slope, as a number up to 1 and a number of doublings.
    let slope = 0.1 / sigma_range;
    let doublings = (0..7).find(|&k| slope / f64::from(1 << k) <= 1.0).unwrap_or(7);
    let scale = (256.0 * slope / f64::from(1 << doublings)).round().clamp(1.0, 256.0) as i64;
    let guide = |channel: u16| i64::from(channel) * scale / 65_536;
    (0..3).map(|c| (guide(a[c]) - guide(b[c])).abs()).sum::<i64>() * (1 << doublings)
}

/// Weighted median: sort the window, and take the first value at which half of the weight is reached.
pub fn median(plan: &Plan, pair: &Pair, maps: &mut Finest) {
    smooth(plan, pair, maps, &Window::of(plan), 1, |validity| changes(plan, validity));
}

/// Whether the median changes a pixel.
pub fn changes(plan: &Plan, validity: i32) -> bool {
    match plan.method.refinement.median {
        Median::Off => false,
        Median::Filled => filled(validity),
        Median::All => known(validity),
    }
}

/// Whether a pixel is filled.
pub fn filled(validity: i32) -> bool {
    invalid(validity) && validity & i32::from(flag::FILLED) != 0
}

fn known(validity: i32) -> bool {
    !invalid(validity) || filled(validity)
}

/// A window of places that are `step` columns and rows apart.
pub struct Window {
    pub radius: i64,
    pub step: (i64, i64),
    /// Whether only every second place counts, in a checkerboard.
    pub checkered: bool,
    /// In places.
    pub sigma_space: f64,
    pub sigma_range: f64,
}

impl Window {
    /// The window of the median.
    pub fn of(plan: &Plan) -> Self {
        let refinement = &plan.method.refinement;
        Self {
            radius: i64::from(refinement.median_window / 2),
            step: (1, 1),
            checkered: false,
            sigma_space: refinement.median_sigma_space,
            sigma_range: refinement.median_sigma_range,
        }
    }
}

/// A place of a window, with a disparity.
pub struct Place {
    /// Its offset from the middle, in places.
    pub step: (i64, i64),
    pub disparity: i32,
    pub weight: i64,
}

/// The places of the window of pixel (x, y), in every second row.
pub fn places(
    plan: &Plan,
    pair: &Pair,
    maps: &Finest,
    window: &Window,
    (x, y): (usize, usize),
) -> Vec<Place> {
    let (width, height) = plan.size();
    let Window { radius, step, checkered, sigma_space, sigma_range } = *window;
    let guide = &pair.left().pixels;
    let mut places = Vec::new();
    for j in (-radius..=radius).filter(|j| j % 2 == 0) {
        for i in (-radius..=radius).filter(|i| !checkered || (i + j / 2) % 2 == 0) {
            let (nx, ny) = (x as i64 + step.0 * i, y as i64 + step.1 * j);
            if nx < 0 || ny < 0 || nx >= width as i64 || ny >= height as i64 {
                continue;
            }
            let at = (nx as usize, ny as usize);
            if known(maps.validity[at]) {
                let colour = colour(guide[(x, y)], guide[at], sigma_range);
                let weight = (127 - colour - space(i, j, sigma_space)).max(0);
                places.push(Place { step: (i, j), disparity: maps.disparity[at], weight });
            }
        }
    }
    places
}

/// The median of a window, rounded to `step`.
pub fn smooth(
    plan: &Plan,
    pair: &Pair,
    maps: &mut Finest,
    window: &Window,
    step: i32,
    touched: impl Fn(i32) -> bool,
) {
    let (width, height) = plan.size();
    let before = maps.clone();
    maps.disparity = Plane::from_fn(width, height, |x, y| {
        if !touched(before.validity[(x, y)]) {
            return before.disparity[(x, y)];
        }
        let mut places = places(plan, pair, &before, window, (x, y));
        places.sort_unstable_by_key(|place| place.disparity);
        let total: i64 = places.iter().map(|place| place.weight).sum();
        let mut cumulated = 0;
        for place in places {
            cumulated += place.weight;
            if cumulated * 2 >= total {
                return (place.disparity + step / 2).div_euclid(step) * step;
            }
        }
        unreachable!("the centre has weight")
    });
}
