//! Cleans points, and spreads them to the pixels around them.

use super::neighbours::{COUNT, Neighbour, Neighbours};
use crate::image::{Image, Pixel, Plane};
use crate::maps::FRACTION;
use crate::prior::{Prior, PriorKind};
use crate::threads::prelude::*;

/// Points beyond this distance say nothing of a pixel, in px.
const REACH: i32 = 64;
/// Two points agree if their disparities differ by at most this, plus a tenth of their distance, in 1/256 px.
const AGREES: i64 = FRACTION as i64;
/// A point stays if this many of its neighbours agree.
const AGREEING: usize = 2;
/// Pixels in blocks of this side share their nearest points.
const BLOCK: usize = 4;
/// Difference of colour that lowers a weight by e, in 1/256 levels.
const COLOUR: i64 = 4 << 8;
/// Resolution of the exponent of weights.
const STEPS: i64 = 16;
/// The largest weight.
const MOST: f64 = 4096.0;
/// Predictions count for the mean if they differ by at most this from the median, in 1/256 px.
const NEAR_MEDIAN: i64 = FRACTION as i64;
/// Largest deviation that counts for the standard deviation, in 1/256 px.
const SPREAD_MOST: i64 = 8 * FRACTION as i64;
/// What the standard deviation of a pixel exceeds that of its points by, if these agree perfectly and lie close, in 1/256 px.
const SIGMA: i64 = FRACTION as i64 / 4;
/// Growth of the standard deviation with the distance of the points, in 1/256 px per px.
const GROWTH: i64 = 38;
/// Pixels with a larger standard deviation remain unknown, in 1/256 px.
const SIGMA_MOST: i64 = 4 * FRACTION as i64;
/// Fractional bits of the slopes of planes.
const SLOPE_BITS: u32 = 8;
/// Largest slope of a plane, in px of disparity per px.
const SLOPE_MOST: i64 = 1;
/// Weight of a slope of 0 in the fit of a plane, relative to the sum of all weights, in px squared.
const FLAT: i64 = 30;

/// The points that enough of their neighbours agree with. If there are too few points to tell, all stay.
pub(super) fn cleaned(prior: &Prior) -> Prior {
    let points = Points::new(prior);
    if points.places.len() <= COUNT {
        return prior.clone();
    }
    let sorted = Neighbours::new(&points.places, prior.size());
    let agreed: Vec<bool> = (0..points.places.len())
        .into_par_iter()
        .map_init(Vec::new, |near, i| {
            sorted.nearest(points.places[i], i32::MAX >> 17, Some(i as u32), near);
            let agrees = |&(squared, j): &Neighbour| {
                let differ = i64::from(points.disparity[i] - points.disparity[j as usize]).abs();
                differ <= AGREES + distance(squared) * i64::from(FRACTION) / 10 / STEPS
            };
            near.iter().filter(|near| agrees(near)).count() >= AGREEING
        })
        .collect();
    let mut cleaned = Prior::nothing(PriorKind::Points, prior.size());
    for (((x, y), disparity, sigma), _) in prior.known().zip(agreed).filter(|(_, agreed)| *agreed) {
        (cleaned.disparity[(x, y)], cleaned.sigma[(x, y)]) = (disparity, sigma);
    }
    cleaned
}

/// Spreads the points of `prior` over `left`, the view that they are in.
///
/// A plane is fitted through each point and its neighbours. For a pixel, the nearest points in all directions predict a disparity, each by
/// its plane, with weights that fall with distance and with the difference of colour. The disparity is the mean of the predictions close
/// to their weighted median. The standard deviation is that of the points, and grows with their deviations from that and with their distance.
pub(super) fn spread(prior: &Prior, left: &Image) -> Prior {
    let points = Points::new(prior);
    let colours = smoothed(left);
    let weights = Weights::new();
    let sorted = Neighbours::new(&points.places, prior.size());
    let planes: Vec<[i64; 2]> = (0..points.places.len())
        .into_par_iter()
        .map_init(Vec::new, |near, i| {
            sorted.nearest(points.places[i], REACH, Some(i as u32), near);
            points.plane(i, near, &colours, &weights)
        })
        .collect();
    let mut spread = Prior::nothing(PriorKind::Points, prior.size());
    let width = left.width();
    let disparity = spread.disparity.data_mut().par_chunks_mut(BLOCK * width);
    let rows = disparity.zip(spread.sigma.data_mut().par_chunks_mut(BLOCK * width)).enumerate();
    rows.for_each_init(Vec::new, |near, (block, (disparity, sigma))| {
        for column in (0..width).step_by(BLOCK) {
            let top = BLOCK * block;
            sorted.nearest(((column + BLOCK / 2) as i32, (top + BLOCK / 2) as i32), REACH, None, near);
            if near.is_empty() {
                continue;
            }
            for row in 0..disparity.len() / width {
                for x in column..(column + BLOCK).min(width) {
                    let found = points.predict((x, top + row), near, &planes, &colours, &weights);
                    if let Some((d, s)) = found {
                        (disparity[row * width + x], sigma[row * width + x]) = (d, s);
                    }
                }
            }
        }
    });
    for ((x, y), d, s) in prior.known() {
        (spread.disparity[(x, y)], spread.sigma[(x, y)]) = (d, s);
    }
    spread
}

/// The points of a prior.
struct Points {
    places: Vec<(i32, i32)>,
    disparity: Vec<i32>,
    sigma: Vec<u16>,
}

impl Points {
    fn new(prior: &Prior) -> Self {
        let places = prior.known().map(|((x, y), ..)| (x as i32, y as i32)).collect();
        let (disparity, sigma) = prior.known().map(|(_, disparity, sigma)| (disparity, sigma)).unzip();
        Self { places, disparity, sigma }
    }

    /// The slopes along x and y of the plane through point `i` that fits its neighbours best.
    fn plane(&self, i: usize, near: &[Neighbour], colours: &Plane<[i32; 3]>, weights: &Weights) -> [i64; 2] {
        let (x, y) = self.places[i];
        let own = colours[(x as usize, y as usize)];
        let scale = scale(near);
        let (mut xx, mut xy, mut yy, mut xd, mut yd, mut sum) =
            (0_i128, 0_i128, 0_i128, 0_i128, 0_i128, 0_i128);
        for &(squared, j) in near {
            let (px, py) = self.places[j as usize];
            let (away, (dx, dy)) = (distance(squared), (i128::from(px - x), i128::from(py - y)));
            let d = i64::from(self.disparity[j as usize] - self.disparity[i]);
            if d.abs() > 3 * AGREES / 2 + away * i64::from(FRACTION) / 10 / STEPS {
                continue;
            }
            let differ = difference(own, colours[(px as usize, py as usize)]);
            let w = i128::from(weights.of(away, scale, differ));
            (xx, xy, yy, sum) = (xx + w * dx * dx, xy + w * dx * dy, yy + w * dy * dy, sum + w);
            (xd, yd) = (xd + w * dx * i128::from(d), yd + w * dy * i128::from(d));
        }
        let (xx, yy) = (xx + i128::from(FLAT) * sum, yy + i128::from(FLAT) * sum);
        let determinant = xx * yy - xy * xy;
        if determinant == 0 {
            return [0; 2];
        }
        let most = i128::from(SLOPE_MOST * i64::from(FRACTION)) << SLOPE_BITS;
        let slope = |n: i128| ((n << SLOPE_BITS).div_euclid(determinant)).clamp(-most, most) as i64;
        [slope(xd * yy - yd * xy), slope(yd * xx - xd * xy)]
    }

    /// The disparity and its standard deviation that the points `near` a pixel predict, in 1/256 px.
    fn predict(
        &self,
        at: (usize, usize),
        near: &[Neighbour],
        planes: &[[i64; 2]],
        colours: &Plane<[i32; 3]>,
        weights: &Weights,
    ) -> Option<(i32, u16)> {
        let own = colours[at];
        let scale = scale(near);
        // (prediction, weight, distance), by prediction.
        let mut each = [(0_i64, 0_i64, 0_i64); COUNT];
        let (mut count, mut sum, mut own_sigma) = (0, 0, 0);
        for &(_, j) in near {
            let (px, py) = self.places[j as usize];
            let (dx, dy) = (at.0 as i64 - i64::from(px), at.1 as i64 - i64::from(py));
            let away = distance((dx * dx + dy * dy) as u32);
            let [a, b] = planes[j as usize];
            let prediction = i64::from(self.disparity[j as usize]) + ((a * dx + b * dy) >> SLOPE_BITS);
            let weight = weights.of(away, scale, difference(own, colours[(px as usize, py as usize)]));
            let place = each[..count].partition_point(|other| other.0 <= prediction);
            each.copy_within(place..count.min(COUNT - 1), place + 1);
            each[place] = (prediction, weight, away);
            (count, sum) = (count + 1, sum + weight);
            own_sigma += weight * i64::from(self.sigma[j as usize]);
        }
        let each = &each[..count];
        let mut below = 0;
        let median = each.iter().find(|(_, weight, _)| {
            below += weight;
            2 * below >= sum
        })?;
        let median = median.0;
        let (mut mean, mut inside, mut deviation, mut away) = (0, 0, 0, 0);
        for &(prediction, weight, distance) in each {
            let off = prediction - median;
            if off.abs() <= NEAR_MEDIAN {
                (mean, inside) = (mean + weight * off, inside + weight);
            }
            deviation += weight * off.abs().min(SPREAD_MOST);
            away += weight * distance;
        }
        let sigma = SIGMA + own_sigma / sum + deviation / sum + GROWTH * away / (sum * STEPS);
        (sigma <= SIGMA_MOST).then(|| ((median + mean / inside.max(1)) as i32, sigma as u16))
    }
}

/// The distance of a squared distance, in 1/16 px.
fn distance(squared: u32) -> i64 {
    (u64::from(squared) * (STEPS * STEPS) as u64).isqrt() as i64
}

/// The distance at which weights fall by e: that of the third nearest point, at least 4 px, in 1/16 px.
fn scale(near: &[Neighbour]) -> i64 {
    near.get(2).or(near.last()).map_or(0, |near| distance(near.0)).max(4 * STEPS)
}

/// The mean difference of two colours, in 1/256 levels.
fn difference(a: [i32; 3], b: [i32; 3]) -> i64 {
    let sum: i32 = a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum();
    i64::from(sum / 3)
}

/// Weights by distance and colour.
struct Weights {
    table: [u16; 192],
}

impl Weights {
    fn new() -> Self {
        let weight = |i: usize| (MOST * libm::exp(-(i as f64) / STEPS as f64) + 0.5).floor().max(1.0) as u16;
        Self { table: std::array::from_fn(weight) }
    }

    /// The weight of a point at a distance of `away`, in the unit of `scale`, whose colour differs by `differ`.
    fn of(&self, away: i64, scale: i64, differ: i64) -> i64 {
        let step = STEPS * away / scale + STEPS * differ / COLOUR;
        self.table[(step as usize).min(self.table.len() - 1)].into()
    }
}

/// The colours of a view, smoothed by 1 2 1 in both directions, in 1/256 levels.
fn smoothed(image: &Image) -> Plane<[i32; 3]> {
    let (width, height) = image.pixels.size();
    let along = |row: &[Pixel], x: usize, c: usize| {
        let at = |x: usize| i32::from(row[x][c]);
        at(x.saturating_sub(1)) + 2 * at(x) + at((x + 1).min(width - 1))
    };
    let mut smoothed = Plane::filled(width, height, [0; 3]);
    smoothed.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        let rows = [y.saturating_sub(1), y, (y + 1).min(height - 1)].map(|y| image.pixels.row(y));
        for (x, out) in out.iter_mut().enumerate() {
            let sum = |c: usize| along(rows[0], x, c) + 2 * along(rows[1], x, c) + along(rows[2], x, c);
            *out = [0, 1, 2].map(|c| sum(c) / 16);
        }
    });
    smoothed
}
