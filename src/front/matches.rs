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

mod corners;
mod correlation;
mod view;

use crate::error::{Purpose, Result};
use crate::image::{Pair, Plane};
use crate::maps::FRACTION;
use crate::memory;
use crate::options::DisparityRange;
use crate::threads;
use crate::threads::prelude::*;
use corners::{SPACING, cell, corners};
use correlation::correlation;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use view::{RADIUS, View};

/// Approximate maximum of corners without a given range: they only serve an overview then, and each is
/// searched in a whole row.
const OVERVIEW: usize = 8192;
/// Without a range, the search covers disparities up to 1 / `REACH` of the width, of either sign.
const REACH: usize = 2;
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

/// A pixel of the left view with its disparity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SparseMatch {
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
pub fn find(
    pair: &Pair,
    zones: Option<(&Plane<u32>, usize)>,
    range: Option<DisparityRange>,
) -> Vec<SparseMatch> {
    let (width, height) = pair.size();
    let spacing = if range.is_some() { SPACING } else { width * height / OVERVIEW };
    search(pair, zones, range, spacing, 0)
}

/// Bytes per pixel that a search takes: the statistics of both views, and the eigenvalues of one; and two
/// copies of the pixels and mask of one view, or one of both, for trying other orientations.
const BYTES: u64 = 2 * (2 + 4 + 8) + 8 + 2 * 9;

/// Fails if the machine has too little memory to search `pair`.
///
/// # Errors
/// [`Error::Memory`](crate::Error::Memory).
pub(super) fn check_memory(pair: &Pair) -> Result<()> {
    let (width, height) = pair.size();
    Ok(memory::check(BYTES * (width * height) as u64, Purpose::Image)?)
}

/// A corner of the left view that was searched.
pub(super) struct Corner {
    /// Its row.
    pub(super) y: usize,
    /// The smaller eigenvalue of its structure tensor.
    pub(super) strength: f64,
    /// How far above or below its row it was found, in 1/256 px, where it was found.
    pub(super) offset: Option<u32>,
}

/// The result of a search.
#[derive(Default)]
pub(super) struct Survey {
    /// The corners that were searched, in raster order.
    pub(super) corners: Vec<Corner>,
    /// The matches that were found.
    pub(super) matches: Vec<SparseMatch>,
}

/// [`find`] with one corner per `spacing` pixels ([`SPACING`] at least), on up to `rows` rows above and below
/// its own.
pub(super) fn search(
    pair: &Pair,
    zones: Option<(&Plane<u32>, usize)>,
    range: Option<DisparityRange>,
    spacing: usize,
    rows: usize,
) -> Vec<SparseMatch> {
    survey(pair, zones, range, spacing, rows).matches
}

/// Like [`search`], and also returns the corners that were searched.
pub(super) fn survey(
    pair: &Pair,
    zones: Option<(&Plane<u32>, usize)>,
    range: Option<DisparityRange>,
    spacing: usize,
    rows: usize,
) -> Survey {
    threads::run(|| surveyed(pair, zones, range, spacing.max(SPACING), rows))
}

fn surveyed(
    pair: &Pair,
    zones: Option<(&Plane<u32>, usize)>,
    range: Option<DisparityRange>,
    spacing: usize,
    rows: usize,
) -> Survey {
    let reach = (pair.size().0 / REACH) as i32;
    let (min, max) = range.map_or((-reach, reach), |r| (r.min, r.max));
    let (left, right) = join(|| View::new(pair.left()), || View::new(pair.right()));
    let corners = corners(&left, zones, spacing);
    let matches = corners
        .par_iter()
        .filter_map(|&(x, y, _)| {
            let there = peak(&left, (x, y), &right, x as i32 - max..=x as i32 - min, rows)?;
            let (rx, ry) = (there.x as i32, there.y as i32);
            let back = peak(&right, (there.x, there.y), &left, rx + min..=rx + max, rows)?;
            (back.x.abs_diff(x) <= 1 && back.y.abs_diff(y) <= 1).then(|| SparseMatch {
                x,
                y,
                disparity: (x as i32 - rx) * FRACTION - there.right,
                dy: (ry - y as i32) * FRACTION + there.down,
                score: there.score,
            })
        })
        .collect();
    let matches = consistent(matches, cell(spacing));
    let mut found = matches.iter().peekable();
    let corners = corners.iter().map(|&(x, y, strength)| {
        let offset = found.next_if(|m| (m.x, m.y) == (x, y)).map(|m| m.dy.unsigned_abs());
        Corner { y, strength, offset }
    });
    Survey { corners: corners.collect(), matches }
}

/// The position at which a window is found.
struct Optimum {
    x: usize,
    y: usize,
    /// Sub-pixel offset of the optimum to the right, in 1/256 px.
    right: i32,
    /// Sub-pixel offset downwards, in 1/256 px.
    down: i32,
    score: f64,
}

/// The position in `columns`, within `rows` of its own row, at which the window of `of` around (x, y) is
/// found in `within`. `None` if the best score is too low, has a close runner-up, or is no optimum along the
/// row.
fn peak(
    of: &View,
    (x, y): (usize, usize),
    within: &View,
    columns: RangeInclusive<i32>,
    rows: usize,
) -> Option<Optimum> {
    let (width, height) = within.grey.size();
    // Search as many columns again on either side: a pattern that repeats there makes the match ambiguous,
    // and an optimum needs columns around it.
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

    // The last one of equal scores; the runner-up test then rejects it.
    let (mut score, mut at) = (f64::NEG_INFINITY, None);
    for (v, row) in scores.iter().enumerate() {
        let best = largest(row);
        if best >= score {
            (score, at) = (best, row.iter().rposition(|other| *other >= best).map(|u| (u, v)));
        }
    }
    let (u, v) = at?;
    let mut runner_up = -1.0_f64;
    for (row, scores) in scores.iter().enumerate() {
        let [before, after] = if row.abs_diff(v) > PEAK_REACH {
            [scores.len(), scores.len()]
        } else {
            [u.saturating_sub(PEAK_REACH), (u + PEAK_REACH + 1).min(scores.len())]
        };
        runner_up = runner_up.max(largest(&scores[..before])).max(largest(&scores[after..]));
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

/// The largest score, found in eight parts at once, since each comparison would wait for the one before.
fn largest(scores: &[f64]) -> f64 {
    let (blocks, rest) = scores.as_chunks::<8>();
    let mut parts = [f64::NEG_INFINITY; 8];
    for block in blocks {
        parts.iter_mut().zip(block).for_each(|(part, score)| *part = part.max(*score));
    }
    parts.iter().chain(rest).copied().fold(f64::NEG_INFINITY, f64::max)
}

/// The vertex of the parabola through `(-1, before)`, `(0, peak)`, `(1, after)`, in 1/256.
fn vertex(before: f64, peak: f64, after: f64) -> i32 {
    let bend = before - 2.0 * peak + after;
    if bend < 0.0 { ((before - after) / (2.0 * bend) * f64::from(FRACTION) + 0.5).floor() as i32 } else { 0 }
}

/// The median; 0 if there are no values.
pub(super) fn median(values: impl Iterator<Item = i32>) -> i32 {
    let mut values: Vec<i32> = values.collect();
    values.sort_unstable();
    values.get(values.len() / 2).copied().unwrap_or(0)
}

/// The matches that agree with others around them, in their own and the adjacent cells (of `side` pixels).
fn consistent(matches: Vec<SparseMatch>, side: usize) -> Vec<SparseMatch> {
    let mut cells = BTreeMap::<(usize, usize), Vec<&SparseMatch>>::new();
    for m in &matches {
        cells.entry((m.x / side, m.y / side)).or_default().push(m);
    }
    let agrees = |m: &SparseMatch| {
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
    matches.par_iter().filter(|m| agrees(m)).copied().collect()
}
