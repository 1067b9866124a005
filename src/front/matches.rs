//! Sparse, highly confident matches (section 2.4): corners of the left view that are found again in the right
//! view.
//!
//! Corners are those of Shi and Tomasi (*Good Features to Track*, 1994), as in the paper. The paper does not
//! say how they are matched; here it is done by zero-mean normalised cross-correlation (ZNCC), and every
//! doubtful match is dropped. A match must score well, be clearly better than its runner-up, be found from
//! the right view too, and agree with the matches around it.
//!
//! Sums are integers, and the rest uses + - * / and square roots in a fixed order. So every machine finds the
//! same matches, with any number of threads.

use crate::error::{Purpose, Result};
use crate::image::{Image, Pair, Plane};
use crate::maps::FRACTION;
use crate::memory;
use crate::options::DisparityRange;
use rayon::prelude::*;
use std::array::from_fn;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// Smallest number of pixels per corner: dense enough for the statistics of a small zone.
const SPACING: usize = 64;
/// Side of the cells over which corners are spread evenly, in pixels, at a spacing of [`SPACING`].
const CELL: usize = 32;
/// Approximate maximum of corners where no range is given: they only serve an overview then, and each is
/// searched in a whole row.
const OVERVIEW: usize = 8192;
/// Without a range, the search covers disparities up to 1 / `REACH` of the width, of either sign.
const REACH: usize = 2;
/// The structure tensor is a sum over 5 x 5 pixels.
const TENSOR_RADIUS: usize = 2;
/// A corner is the maximum of 5 x 5 pixels.
const PEAK_RADIUS: usize = 2;
/// The correlation window is 7 x 7 pixels: exactly the pixels that a corner's tensor depends on, gradients
/// included. (9 x 9 gave a fifth fewer matches on five real pairs; the share of false ones rose on three and
/// fell on two.)
const RADIUS: usize = TENSOR_RADIUS + 1;
/// Smallest ZNCC of a match.
const MIN_SCORE: f64 = 0.8;
/// Ratio test: a match's distance from a perfect score is at most this fraction of its runner-up's.
const RATIO: f64 = 0.7;
/// Positions this close to the best one, in pixels along both axes, belong to the same optimum and are no
/// runners-up.
const PEAK_REACH: usize = 2;
/// Each match is compared with this many matches around it.
const NEIGHBOURS: usize = 8;
/// This many of them must agree with it.
const AGREEING: usize = 4;
/// Matches agree where they differ by at most one pixel, plus one pixel for every this many pixels between
/// them, because surfaces slant.
const SLOPE: i64 = 8;

const WINDOW: usize = 2 * RADIUS + 1;
const WINDOW_PIXELS: i64 = (WINDOW * WINDOW) as i64;
/// Grey is in 1/16 of an 8-bit level: the finest unit for which the sums over a window fit in 32 bits.
const GREY_SHIFT: u32 = 4;
const _: () = assert!(WINDOW_PIXELS * (0xffff >> GREY_SHIFT) * (0xffff >> GREY_SHIFT) <= i32::MAX as i64);

/// A pixel of the left view with its disparity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// Column in the left view, in pixels.
    pub x: usize,
    /// Row in the left view, in pixels.
    pub y: usize,
    /// Disparity in 1/256 px: the left pixel appears at x - disparity / 256 in the right view.
    pub disparity: i32,
    /// Vertical offset in the right view, downwards, in 1/256 px; 0 where only the pixel's own row was
    /// searched.
    pub dy: i32,
    /// Zero-mean normalised cross-correlation of the two windows, up to 1.
    pub score: f64,
}

/// The matches of `pair`, in raster order: at most about one per 64 pixels.
///
/// `zones` is a map of zone indices and their number. Each zone contributes its own best corners, so that
/// zones of low contrast get some too; pixels whose index is out of range contribute none. `range` is the
/// range to search. Without it, all disparities of either sign up to half the width are searched, for at most
/// about 8000 corners. No window ever contains a masked pixel.
///
/// # Panics
/// When the map of zones differs in size from the images.
#[must_use]
pub fn find(pair: &Pair, zones: Option<(&Plane<u32>, usize)>, range: Option<DisparityRange>) -> Vec<Match> {
    let (width, height) = pair.size();
    let spacing = if range.is_some() { SPACING } else { width * height / OVERVIEW };
    search(pair, zones, range, spacing, 0)
}

/// Bytes per pixel that a search takes: the statistics of both views, and the eigenvalues of one; and two
/// copies of the pixels and mask of one view, for trying its other orientations.
const BYTES: u64 = 2 * (2 + 4 + 8) + 8 + 2 * 9;

/// Fails where the machine has not enough memory to search `pair`.
///
/// # Errors
/// [`Error::Memory`](crate::Error::Memory).
pub(super) fn check_memory(pair: &Pair) -> Result<()> {
    let (width, height) = pair.size();
    Ok(memory::check(BYTES * (width * height) as u64, Purpose::Image)?)
}

/// [`find`] with one corner per `spacing` pixels ([`SPACING`] at least), on up to `rows` rows above and below
/// its own.
pub(super) fn search(
    pair: &Pair,
    zones: Option<(&Plane<u32>, usize)>,
    range: Option<DisparityRange>,
    spacing: usize,
    rows: usize,
) -> Vec<Match> {
    let spacing = spacing.max(SPACING);
    let reach = (pair.size().0 / REACH) as i32;
    let (min, max) = range.map_or((-reach, reach), |r| (r.min, r.max));
    let (left, right) = (View::new(pair.left()), View::new(pair.right()));
    let matches = corners(&left, zones, spacing)
        .into_par_iter()
        .filter_map(|(x, y)| {
            let there = peak(&left, (x, y), &right, x as i32 - max..=x as i32 - min, rows)?;
            let (rx, ry) = (there.x as i32, there.y as i32);
            let back = peak(&right, (there.x, there.y), &left, rx + min..=rx + max, rows)?;
            (back.x.abs_diff(x) <= 1 && back.y.abs_diff(y) <= 1).then(|| Match {
                x,
                y,
                disparity: (x as i32 - rx) * FRACTION - there.right,
                dy: (ry - y as i32) * FRACTION + there.down,
                score: there.score,
            })
        })
        .collect();
    consistent(matches, cell(spacing))
}

/// Side of a cell in pixels, such that a cell holds about the same number of corners at any spacing.
fn cell(spacing: usize) -> usize {
    CELL * (spacing / SPACING).isqrt().max(1)
}

/// A view, and the statistics of the window around each pixel.
struct View {
    /// In 1/16 of an 8-bit level.
    grey: Plane<i16>,
    /// The sum over the window around each pixel.
    sum: Plane<i32>,
    /// n sigma of the n values of each window; 0 where it is uniform, contains a masked pixel, or leaves the
    /// image.
    norm: Plane<f64>,
}

impl View {
    fn new(image: &Image) -> Self {
        let grey = image.pixels.map(|p| (p[3] >> GREY_SHIFT) as i16);
        let (width, height) = grey.size();
        let any_masked = image.masked.data().contains(&true);
        // One allocation each: rows of a large image that are freed one by one may stay with the process.
        let (mut sums, mut norms) = (Plane::filled(width, height, 0), Plane::filled(width, height, 0.0));
        let rows = sums.data_mut().par_chunks_mut(width).zip(norms.data_mut().par_chunks_mut(width));
        rows.enumerate().for_each(|(y, (sums, norms))| {
            let sum = sums_of(&grey, y, |&v| i32::from(v));
            let squares = sums_of(&grey, y, |&v| i32::from(v).pow(2));
            for (norm, (sum, squares)) in norms.iter_mut().zip(sum.iter().zip(&squares)) {
                let variance = WINDOW_PIXELS * i64::from(*squares) - i64::from(*sum).pow(2);
                *norm = (variance as f64).sqrt();
            }
            if any_masked {
                let masked = sums_of(&image.masked, y, |&v| i32::from(v));
                norms
                    .iter_mut()
                    .zip(masked)
                    .filter(|(_, masked)| *masked > 0)
                    .for_each(|(norm, _)| *norm = 0.0);
            }
            sums.copy_from_slice(&sum);
        });
        Self { grey, sum: sums, norm: norms }
    }

    /// The smaller eigenvalue of the structure tensor at each pixel of row `y`; 0 where the window does not
    /// fit.
    fn eigenvalues(&self, y: usize) -> Vec<f64> {
        let g = &self.grey;
        if y < RADIUS || y + RADIUS >= g.height() {
            return vec![0.0; g.width()];
        }
        let xx = gradient_sums(g, y, |dx, _| dx * dx);
        let xy = gradient_sums(g, y, |dx, dy| dx * dy);
        let yy = gradient_sums(g, y, |_, dy| dy * dy);
        let eigenvalue = |x: usize| {
            let [xx, xy, yy] = [&xx, &xy, &yy].map(|sums| sums[x] as f64);
            let root = ((xx - yy) * (xx - yy) + 4.0 * xy * xy).sqrt();
            if self.norm[(x, y)] > 0.0 { (xx + yy - root) / 2.0 } else { 0.0 }
        };
        (0..g.width()).map(eigenvalue).collect()
    }
}

/// Sums of `value` over the correlation windows around the pixels of row `y`; 0 where a window leaves the plane.
fn sums_of<T>(plane: &Plane<T>, y: usize, value: impl Fn(&T) -> i32) -> Vec<i32> {
    box_sums(plane.size(), y, RADIUS, |y, columns| {
        columns.iter_mut().zip(plane.row(y)).for_each(|(sum, v)| *sum += value(v));
    })
}

/// Sums of a product of gradients over the windows of the tensors of row `y`. Tensors count only where the correlation window fits,
/// so none has a gradient at either end of a row.
fn gradient_sums(grey: &Plane<i16>, y: usize, product: impl Fn(i32, i32) -> i32) -> Vec<i32> {
    box_sums(grey.size(), y, TENSOR_RADIUS, |y, columns| {
        let across = grey.row(y)[2..].iter().zip(grey.row(y));
        let down = grey.row(y + 1)[1..].iter().zip(&grey.row(y - 1)[1..]);
        for ((sum, (right, left)), (below, above)) in columns[1..].iter_mut().zip(across).zip(down) {
            *sum += product(i32::from(right - left), i32::from(below - above));
        }
    })
}

/// Sums over the squares around the pixels of row `y` of a plane, to whose columns `add` adds the values of a row; 0 where a square
/// leaves the plane.
fn box_sums(
    (width, height): (usize, usize),
    y: usize,
    radius: usize,
    add: impl Fn(usize, &mut [i32]),
) -> Vec<i32> {
    let mut out = vec![0; width];
    if y < radius || y + radius >= height || width <= 2 * radius {
        return out;
    }
    let mut columns = vec![0; width];
    (y - radius..=y + radius).for_each(|y| add(y, &mut columns));
    let mut sum: i32 = columns[..2 * radius].iter().sum();
    for x in radius..width - radius {
        sum += columns[x + radius];
        out[x] = sum;
        sum -= columns[x - radius];
    }
    out
}

/// Corners of `view` in raster order: the best of each zone in each cell of the image, one per `spacing`
/// pixels.
fn corners(view: &View, zones: Option<(&Plane<u32>, usize)>, spacing: usize) -> Vec<(usize, usize)> {
    let (width, height) = view.grey.size();
    if let Some((map, _)) = zones {
        assert_eq!(map.size(), (width, height), "the map of zones has the size of the images");
    }
    let mut values = Plane::filled(width, height, 0.0);
    let rows = values.data_mut().par_chunks_mut(width).enumerate();
    rows.for_each(|(y, row)| row.copy_from_slice(&view.eigenvalues(y)));
    // On a tie, the earlier one in raster order wins.
    let is_peak = |x: usize, y: usize| {
        let value = values[(x, y)];
        value > 0.0
            && (y - PEAK_RADIUS..=y + PEAK_RADIUS).all(|v| {
                (x - PEAK_RADIUS..=x + PEAK_RADIUS)
                    .all(|u| value.total_cmp(&values[(u, v)]).then((v, u).cmp(&(y, x))).is_ge())
            })
    };
    let side = cell(spacing);
    let cells: Vec<(usize, usize)> =
        (0..height).step_by(side).flat_map(|y| (0..width).step_by(side).map(move |x| (x, y))).collect();
    let mut out: Vec<_> = cells
        .into_par_iter()
        .flat_map_iter(|(left, top)| {
            let mut of_zone = BTreeMap::<u32, (usize, Vec<(usize, usize)>)>::new();
            for y in top..(top + side).min(height) {
                for x in left..(left + side).min(width) {
                    let zone = zones.map_or(0, |(map, _)| map[(x, y)]);
                    if zones.is_none_or(|(_, count)| (zone as usize) < count) {
                        let (pixels, optima) = of_zone.entry(zone).or_default();
                        *pixels += 1;
                        if is_peak(x, y) {
                            optima.push((x, y));
                        }
                    }
                }
            }
            of_zone.into_values().flat_map(|(pixels, mut optima)| {
                optima.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
                optima.truncate(pixels.div_ceil(spacing));
                optima
            })
        })
        .collect();
    out.sort_by_key(|&(x, y)| (y, x));
    out
}

/// The position where a window is found again.
struct Optimum {
    x: usize,
    y: usize,
    /// Sub-pixel offset of the optimum to the right, in 1/256 px.
    right: i32,
    /// Sub-pixel offset downwards, in 1/256 px.
    down: i32,
    score: f64,
}

/// The one position in `columns`, within `rows` of its own row, where the window of `of` around (x, y) is
/// found in `within`. `None` where the best score is too low, has a runner-up, or is no optimum along the
/// row.
fn peak(
    of: &View,
    (x, y): (usize, usize),
    within: &View,
    columns: RangeInclusive<i32>,
    rows: usize,
) -> Option<Optimum> {
    let (width, height) = within.grey.size();
    // As many columns again on either side: a pattern that repeats there gives no reliable match here, and an
    // optimum needs columns around it.
    let aside = columns.end() - columns.start() + 1;
    let first = (columns.start() - aside).max(RADIUS as i32);
    let last = (columns.end() + aside).min(width as i32 - 1 - RADIUS as i32);
    if last < first + 2 {
        return None;
    }
    let (first, last) = (first as usize, last as usize);
    let top = y.saturating_sub(rows).max(RADIUS);
    let bottom = (y + rows).min(height - 1 - RADIUS);
    let scores: Vec<Vec<f64>> =
        (top..=bottom).map(|v| correlation(of, (x, y), within, v, first..=last)).collect();

    // Of equal scores the last one; the runner-up test then rejects it.
    let (mut score, mut at) = (f64::NEG_INFINITY, None);
    for (v, row) in scores.iter().enumerate() {
        let most = row.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if most >= score {
            (score, at) = (most, row.iter().rposition(|other| *other >= most).map(|u| (u, v)));
        }
    }
    let (u, v) = at?;
    let mut runner_up = -1.0;
    for (row, scores) in scores.iter().enumerate() {
        let [before, after] = if row.abs_diff(v) > PEAK_REACH {
            [scores.len(), scores.len()]
        } else {
            [u.saturating_sub(PEAK_REACH), (u + PEAK_REACH + 1).min(scores.len())]
        };
        runner_up = scores[..before].iter().chain(&scores[after..]).copied().fold(runner_up, f64::max);
    }
    let sure = score >= MIN_SCORE && 1.0 - score <= RATIO * (1.0 - runner_up);
    let is_peak = u > 0 && u + 1 < scores[v].len();
    if !sure || !is_peak || !columns.contains(&((first + u) as i32)) {
        return None;
    }
    let right = vertex(scores[v][u - 1], score, scores[v][u + 1]);
    let down =
        if v == 0 || v + 1 == scores.len() { 0 } else { vertex(scores[v - 1][u], score, scores[v + 1][u]) };
    Some(Optimum { x: first + u, y: top + v, right, down, score })
}

/// ZNCC of the window of `of` around (x, y) with those of `within` on row `v`; 0 where the window does not
/// fit.
fn correlation(
    of: &View,
    (x, y): (usize, usize),
    within: &View,
    v: usize,
    columns: RangeInclusive<usize>,
) -> Vec<f64> {
    let (first, count) = (*columns.start(), columns.count());
    let template = from_fn(|row| from_fn(|column| of.grey[(x + column - RADIUS, y + row - RADIUS)]));
    let lines = from_fn(|row| &within.grey.row(v + row - RADIUS)[first - RADIUS..]);
    let mut products = vec![0; count];
    products_along(&template, &lines, &mut products);
    let mut scores = vec![0.0; count];
    let there = (&within.sum.row(v)[first..first + count], &within.norm.row(v)[first..first + count]);
    scores_along(&products, (of.sum[(x, y)], of.norm[(x, y)]), there, &mut scores);
    scores
}

/// The scores of windows with these products, by the sum and the norm of the one and of each of the others. All but the last division is
/// exact, since nothing reaches 2^53.
#[pulp::with_simd(scores_along = pulp::Arch::new())]
#[inline(always)]
fn scores_along_on<'a, S: pulp::Simd>(
    _: S,
    products: &'a [i32],
    (sum, norm): (i32, f64),
    (sums, norms): (&'a [i32], &'a [f64]),
    out: &'a mut [f64],
) {
    let there = sums.iter().zip(norms);
    for (out, (product, (there, of_there))) in out.iter_mut().zip(products.iter().zip(there)) {
        let norms = norm * of_there;
        let covariance = WINDOW_PIXELS as f64 * f64::from(*product) - f64::from(sum) * f64::from(*there);
        *out = if norms > 0.0 { covariance / norms } else { 0.0 };
    }
}

/// The sum of the products of `template` with the window that begins at each position of `lines`.
#[pulp::with_simd(products_along = pulp::Arch::new())]
#[inline(always)]
fn products_along_on<'a, S: pulp::Simd>(
    _: S,
    template: &'a [[i16; WINDOW]; WINDOW],
    lines: &'a [&'a [i16]; WINDOW],
    out: &'a mut [i32],
) {
    let (blocks, rest) = out.as_chunks_mut::<32>();
    let first_of_rest = 32 * blocks.len();
    for (i, block) in blocks.iter_mut().enumerate() {
        *block = products_at(template, lines, 32 * i);
    }
    for (i, sum) in rest.iter_mut().enumerate() {
        [*sum] = products_at(template, lines, first_of_rest + i);
    }
}

/// The same at `N` positions from `first` on; so few sums stay in registers.
#[inline(always)]
fn products_at<const N: usize>(
    template: &[[i16; WINDOW]; WINDOW],
    lines: &[&[i16]; WINDOW],
    first: usize,
) -> [i32; N] {
    let mut sums = [0; N];
    for (template, line) in template.iter().zip(lines) {
        let line = &line[first..first + WINDOW - 1 + N];
        for (column, &t) in template.iter().enumerate() {
            for (sum, &value) in sums.iter_mut().zip(&line[column..]) {
                *sum += t as i32 * value as i32;
            }
        }
    }
    sums
}

/// The vertex of the parabola through `(-1, before)`, `(0, peak)`, `(1, after)`, in 1/256.
fn vertex(before: f64, peak: f64, after: f64) -> i32 {
    let bend = before - 2.0 * peak + after;
    if bend < 0.0 { ((before - after) / (2.0 * bend) * f64::from(FRACTION) + 0.5).floor() as i32 } else { 0 }
}

/// The median; 0 of nothing.
pub(super) fn median(values: impl Iterator<Item = i32>) -> i32 {
    let mut values: Vec<i32> = values.collect();
    values.sort_unstable();
    values.get(values.len() / 2).copied().unwrap_or(0)
}

/// The matches that agree with others around them, in their own and the adjacent cells (of `side` pixels).
fn consistent(matches: Vec<Match>, side: usize) -> Vec<Match> {
    let mut cells = BTreeMap::<(usize, usize), Vec<&Match>>::new();
    for m in &matches {
        cells.entry((m.x / side, m.y / side)).or_default().push(m);
    }
    let agrees = |m: &Match| {
        let (i, j) = (m.x / side, m.y / side);
        let mut around: Vec<_> = (j.saturating_sub(1)..=j + 1)
            .flat_map(|j| (i.saturating_sub(1)..=i + 1).map(move |i| (i, j)))
            .filter_map(|cell| cells.get(&cell))
            .flatten()
            .map(|n| ((n.x.abs_diff(m.x).pow(2) + n.y.abs_diff(m.y).pow(2)) as i64, n))
            .filter(|(distance, _)| *distance > 0)
            .collect();
        around.sort_by_key(|(distance, n)| (*distance, n.y, n.x));
        let agreeing = around.iter().take(NEIGHBOURS).filter(|(distance, n)| {
            let allowed = FRACTION as i64 * (SLOPE + distance.isqrt()) / SLOPE;
            let apart = n.disparity.abs_diff(m.disparity).max(n.dy.abs_diff(m.dy));
            i64::from(apart) <= allowed
        });
        agreeing.count() >= AGREEING
    };
    matches.iter().filter(|m| agrees(m)).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_zone_gives_its_own_best_corners() {
        // Noise in bands of 16 rows, every other one with an eighth of the contrast.
        let faint = |y: usize| y / 16 % 2 == 1;
        let image = Image::from_rgb8(&Plane::from_fn(192, 128, |x, y| {
            let seed = (x as u32).wrapping_mul(0x9e37_79b9) ^ (y as u32).wrapping_mul(0x85eb_ca6b);
            let noise = ((seed ^ seed >> 15).wrapping_mul(0xc2b2_ae35) >> 24) as u8;
            [if faint(y) { 112 + noise / 8 } else { noise }; 3]
        }));
        let view = View::new(&image);
        let zones = Plane::from_fn(192, 128, |_, y| u32::from(faint(y)));
        let found = |zones| {
            let all = corners(&view, zones, 256);
            assert!(all.len() <= 192 * 128 / 256);
            all.iter().filter(|(_, y)| faint(*y)).count()
        };
        let (with, without) = (found(Some((&zones, 2))), found(None));
        assert!(with >= 40 && without <= 10, "{with} with zones, {without} without");

        // The maximum is among them, and no corner is next to a better one.
        let all = corners(&view, None, 256);
        let values: Vec<Vec<f64>> = (0..128).map(|y| view.eigenvalues(y)).collect();
        for &(x, y) in &all {
            let around = (y - 2..=y + 2).flat_map(|v| (x - 2..=x + 2).map(move |u| (u, v)));
            assert!(around.into_iter().all(|(u, v)| values[v][u] <= values[y][x]));
        }
    }

    #[test]
    fn a_corner_has_two_large_eigenvalues() {
        // A square on black: the corners are found, the sides are not.
        let image = Image::from_rgb8(&Plane::from_fn(40, 40, |x, y| {
            [if (10..30).contains(&x) && (10..30).contains(&y) { 200 } else { 0 }; 3]
        }));
        let view = View::new(&image);
        let row = view.eigenvalues(20);
        assert!(row.iter().all(|&value| value == 0.0), "{row:?}");
        let found = corners(&view, None, 64);
        assert_eq!(found.len(), 4, "{found:?}");
        for (x, y) in found {
            assert!([x, y].iter().all(|c| c.abs_diff(10).min(c.abs_diff(29)) <= 1), "{x}, {y}");
        }
        let at = |x: usize, y: usize| f64::from(view.grey[(x, y)]);
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for (x, y) in (8..13).flat_map(|y| (8..13).map(move |x| (x, y))) {
            let (dx, dy) = (at(x + 1, y) - at(x - 1, y), at(x, y + 1) - at(x, y - 1));
            xx += dx * dx;
            xy += dx * dy;
            yy += dy * dy;
        }
        let value = view.eigenvalues(10)[10];
        // For [[xx, xy], [xy, yy]]: the determinant of the tensor minus the value on its diagonal is 0.
        let determinant = (xx - value) * (yy - value) - xy * xy;
        assert!(value > 0.0 && determinant.abs() < 1e-9 * xx * yy && 2.0 * value <= xx + yy);
    }
}
