use super::Finest;
use super::fill::invalid;
use super::median::filled;
use mrfgs::image::Pair;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::plan::patches::{
    PATCH_APART, PATCH_AWAY, PATCH_DOUBT, PATCH_LEAST, PATCH_MOMENT, PATCH_OUTVOTES, PATCH_REACH,
    PATCH_RESIDUAL, PATCH_RIDGE, PATCH_SHARE_BITS, PATCH_SPREAD, PATCH_STEEPEST, PATCH_STEP, PATCH_STEP_BITS,
};
use mrfgs::low_level::weights::patch_weights;
use mrfgs::maps::flag;
use mrfgs::options::{Fill, MatchSize};

/// A patch: column and row.
type Patch = (usize, usize);

/// Moments: the weight, the `mean` of x, y and disparity, and the moments of each pair of these.
#[derive(Clone, Copy, Default)]
struct Moments {
    weight: i64,
    mean: [i64; 3],
    pairs: [[i64; 3]; 3],
}

/// A plane through the moments: its value, its slopes, and whether it is trusted.
type Fit = Option<(i64, [i64; 2], bool)>;

/// Filled pixels, and unsure measured ones far from their plane, take planes through measured pixels.
pub fn far_plane(plan: &Plan, pair: &Pair, maps: &mut Finest) {
    let refinement = &plan.method.refinement;
    let half = plan.method.schedule.match_size == MatchSize::Half;
    if refinement.fill != Fill::Votes || !refinement.plane || half {
        return;
    }
    let (width, height) = maps.disparity.size();
    let (across, down) = (width.div_ceil(4), height.div_ceil(4));
    let all: Vec<Patch> = (0..down).flat_map(|y| (0..across).map(move |x| (x, y))).collect();
    let mut fits: Vec<Fit> = vec![None; all.len()];
    for _ in 0..2 {
        let own: Vec<Moments> = all.iter().zip(&fits).map(|(at, fit)| own(maps, *at, fit)).collect();
        let own = |(x, y): Patch| own[y * across + x];
        let share = |a: Patch, b: Patch| share(colour(pair, a), colour(pair, b), &own(a), &own(b));
        let rows: Vec<Moments> = all
            .iter()
            .map(|&(x, y)| {
                let steps: Vec<i64> = (1..across).map(|x| share((x - 1, y), (x, y))).collect();
                sum((0..across).map(|x| own((x, y))).collect(), 0, &steps, x)
            })
            .collect();
        let columns = all.iter().map(|&(x, y)| {
            let steps: Vec<i64> = (1..down).map(|y| share((x, y - 1), (x, y))).collect();
            sum((0..down).map(|y| rows[y * across + x]).collect(), 1, &steps, y)
        });
        fits = columns.map(|sum| fit(&sum)).collect();
    }
    let [low, high] = [plan.range.min, plan.range.max].map(|d| 256 * i64::from(d));
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let Some(plane @ (_, _, true)) = fits[y / 4 * across + x / 4] else { continue };
        let (at, value) = ((x, y), value(plane, x, y).clamp(low, high) as i32);
        let far = (maps.disparity[at] - value).abs() > PATCH_OUTVOTES;
        if filled(maps.validity[at]) {
            maps.disparity[at] = value;
        } else if !invalid(maps.validity[at]) && maps.confidence[at] < PATCH_DOUBT as i32 && far {
            maps.disparity[at] = value;
            (maps.validity[at], maps.confidence[at]) = (i32::from(flag::OUTVOTED | flag::FILLED), 0);
        }
    }
}

/// The pixels of a patch.
fn pixels((x, y): Patch, (width, height): (usize, usize)) -> Vec<(usize, usize)> {
    let all = (0..16).map(|i| (4 * x + i % 4, 4 * y + i / 4));
    all.filter(|&(x, y)| x < width && y < height).collect()
}

fn colour(pair: &Pair, patch: Patch) -> [i64; 3] {
    let seen = pixels(patch, pair.size()).into_iter().filter(|&at| !pair.left().masked[at]);
    let seen: Vec<_> = seen.map(|at| pair.left().pixels[at]).collect();
    let n = seen.len() as i64;
    [0, 1, 2].map(|c| {
        let sum: i64 = seen.iter().map(|pixel| i64::from(pixel[c]) / 256).sum();
        if n == 0 { 0 } else { (2 * sum + n) / (2 * n) }
    })
}

fn share(a: [i64; 3], b: [i64; 3], own: &Moments, other: &Moments) -> i64 {
    let mut apart: i64 = (0..3).map(|c| (a[c] - b[c]).abs()).sum();
    if own.weight > 0 && other.weight > 0 {
        let step = (own.mean[2] - other.mean[2]).abs() - i64::from(PATCH_STEP);
        apart += step.max(0) >> PATCH_STEP_BITS;
    }
    let shares = patch_weights();
    i64::from(shares[(apart as usize).min(shares.len() - 1)])
}

/// Pixel positions relative to the middle of a patch, in half pixels.
fn middle(at: usize) -> i64 {
    [-3, -1, 1, 3][at % 4]
}

fn value((value, slopes, _): (i64, [i64; 2], bool), x: usize, y: usize) -> i64 {
    (value + (slopes[0] * middle(x)).div_euclid(16) + (slopes[1] * middle(y)).div_euclid(16) + 2)
        .div_euclid(4)
}

fn own(maps: &Finest, patch: Patch, fit: &Fit) -> Moments {
    let weight = |at: (usize, usize)| {
        let confidence = i64::from(maps.confidence[at]);
        match fit {
            _ if invalid(maps.validity[at]) => 0,
            Some(plane) => {
                let far = (i64::from(maps.disparity[at]) - value(*plane, at.0, at.1)).abs();
                confidence * (1024 - far).max(0) / 1024
            }
            None => confidence,
        }
    };
    let weighed: Vec<_> =
        pixels(patch, maps.disparity.size()).into_iter().map(|at| (at, weight(at))).collect();
    let Some(first) = weighed.iter().find(|(_, w)| *w > 0) else { return Moments::default() };
    let first = i64::from(maps.disparity[first.0]);
    let spread = i64::from(PATCH_SPREAD);
    let places: Vec<_> = weighed
        .iter()
        .map(|&(at, w)| {
            let e = (i64::from(maps.disparity[at]) - first).div_euclid(16).clamp(-spread, spread);
            (w, [middle(at.0), middle(at.1), e])
        })
        .collect();
    let s: i64 = places.iter().map(|(w, _)| w).sum();
    let one = |a: usize| places.iter().map(|(w, p)| w * p[a]).sum::<i64>();
    let two = |a: usize, b: usize| places.iter().map(|(w, p)| w * p[a] * p[b]).sum::<i64>();
    let mut pairs = [[0; 3]; 3];
    for (a, b) in [(0, 0), (0, 1), (1, 1)] {
        pairs[a][b] = (two(a, b) - one(a) * one(b) / s) / s;
    }
    for a in 0..2 {
        pairs[a][2] = (two(a, 2) - one(a) * (one(2) / s)) / (2 * s);
    }
    pairs[2][2] = (two(2, 2) - one(2) * (one(2) / s)) / s;
    let mean = [512 * one(0) / s, 512 * one(1) / s, 4 * first + 64 * one(2) / s];
    Moments { weight: (s + 4) / 8, mean, pairs }
}

/// The sum of a line of patches at patch `i`, with the `shares` that remain after each step.
fn sum(line: Vec<Moments>, axis: usize, shares: &[i64], i: usize) -> Moments {
    let ahead = (0..i).fold(line[0], |sum, i| and(line[i + 1], carried(sum, axis, -4096, shares[i])));
    let behind = (i + 1..line.len()).rev();
    let behind =
        behind.fold(Moments::default(), |sum, i| carried(and(line[i], sum), axis, 4096, shares[i - 1]));
    and(ahead, behind)
}

fn carried(mut m: Moments, axis: usize, by: i64, share: i64) -> Moments {
    let reach = i64::from(PATCH_REACH);
    m.mean[axis] = (m.mean[axis] + by).clamp(-reach, reach);
    m.weight = m.weight * share / 256;
    m
}

fn and(a: Moments, b: Moments) -> Moments {
    match (a.weight, b.weight) {
        (_, 0) => return a,
        (0, _) => return b,
        _ => {}
    }
    let weight = a.weight + b.weight;
    let r = b.weight * 1024 / weight;
    let t = r * (1024 - r) / 1024;
    let most = [PATCH_AWAY, PATCH_AWAY, PATCH_APART].map(i64::from);
    let apart = [0, 1, 2].map(|i| (b.mean[i] - a.mean[i]).clamp(-most[i], most[i]));
    let coarse = [apart[0].div_euclid(256), apart[1].div_euclid(256), apart[2].div_euclid(64)];
    let toward = |from: i64, by: i64| from + (by * r + 512).div_euclid(1024);
    let mut pairs = [[0; 3]; 3];
    for (i, j) in [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)] {
        let unit = if (i, j) == (2, 2) { 1024 } else { 4096 };
        let between = (coarse[i] * coarse[j] * t + unit / 2).div_euclid(unit);
        let moment = toward(a.pairs[i][j], b.pairs[i][j] - a.pairs[i][j]) + between;
        pairs[i][j] = moment.clamp(-i64::from(PATCH_MOMENT), PATCH_MOMENT.into());
    }
    Moments { weight, mean: [0, 1, 2].map(|i| toward(a.mean[i], apart[i])), pairs }
}

fn fit(m: &Moments) -> Fit {
    if m.weight < PATCH_LEAST.into() {
        return None;
    }
    let square = [0, 1].map(|i| m.pairs[i][i] + i64::from(PATCH_RIDGE));
    let (p, q) = if square[0] >= square[1] { (0, 1) } else { (1, 0) };
    let (mixed, moment) = (m.pairs[0][1], i64::from(PATCH_MOMENT));
    let steepest = i64::from(PATCH_STEEPEST);
    let g = (2048 * mixed / square[p]).clamp(-2048, 2048);
    let k = (m.pairs[q][2] - (g * m.pairs[p][2]).div_euclid(2048)).clamp(-moment, moment);
    let rest = (square[q] - (g * mixed).div_euclid(2048)).max(1);
    let mut slopes = [0; 2];
    slopes[q] = (2048 * k / rest).clamp(-steepest, steepest);
    let along = 2048 * m.pairs[p][2] / square[p] - (g * slopes[q]).div_euclid(2048);
    slopes[p] = along.clamp(-steepest, steepest);
    let mut value = m.mean[2];
    let mut left = m.pairs[2][2];
    for i in 0..2 {
        value -= (slopes[i] * m.mean[i].div_euclid(64)).div_euclid(128);
        let (high, low) = (m.pairs[i][2].div_euclid(1024), m.pairs[i][2].rem_euclid(1024));
        left -= 2 * slopes[i] * high + (slopes[i] * low).div_euclid(512);
    }
    let trusted = left < i64::from(PATCH_RESIDUAL).max(m.pairs[2][2].div_euclid(1 << PATCH_SHARE_BITS));
    Some((value, slopes, trusted))
}
