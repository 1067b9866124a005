//! Rectification of a pair by its own matches: from a coarse search of the whole image to a fine one along the rows.

use super::matches::{self, Match};
use crate::error::{Error, RectificationError, Result};
use crate::image::{Image, Pair};
use crate::maps::FRACTION;
use crate::options::DisparityRange;
use crate::rectification::{Correspondence, Options, Rectification};

/// The longer side of the smallest pair, in pixels, and of the largest that is searched, are at most this (open).
const SIDES: [usize; 2] = [320, 1600];
/// In the smallest pair, matches are searched up to 1 / `REACH` of the height above and below.
const REACH: usize = 3;
/// By so many degrees the right view is turned for that search, one after the other, until enough matches agree: windows that are turned by
/// about 10 degrees still look alike.
const TURNS: [f64; 5] = [0.0, 12.0, -12.0, 24.0, -24.0];
/// Rows above and below, in a pair that is nearly rectified.
const ROWS: usize = 4;
/// Approximate number of corners that are searched in the smallest pair, and in others.
const CORNERS: [usize; 2] = [1024, 4096];
/// Pixels beside the disparities that were found, and a part of their span, that are searched too.
const MARGIN: (f64, f64) = (4.0, 0.125);

impl Rectification {
    /// The rectification of `pair` by matches of its own, as [`Rectification::of_matches`] makes it of them: for two photographs of one
    /// camera that was moved to the side. It may have turned: by some degrees up or to a side, and by up to about 30 about its axis. Masked
    /// pixels do not count.
    ///
    /// Corners of the left image are searched in a smaller pair, far to all sides. Then the pair is rectified by these matches, and the
    /// corners are searched anew in that, along the rows: views that were turned look alike there. That is repeated at twice the size,
    /// up to 1600 pixels.
    ///
    /// # Errors
    /// Those of [`Rectification::of_matches`]; [`Error::Memory`] when the machine has not enough for the search.
    pub fn of_pair(pair: &Pair, options: &Options) -> Result<Self> {
        Self::of_matches(&Self::matches_of(pair)?, pair.size(), options)
    }

    /// The matches of `pair` by which [`Rectification::of_pair`] rectifies it.
    ///
    /// # Errors
    /// Those of [`Rectification::of_pair`] that concern matches.
    pub fn matches_of(pair: &Pair) -> Result<Vec<Correspondence>> {
        matches::check_memory(pair)?;
        // Of pairs at 1, 1/2, 1/4 of the size and so on.
        let mut pairs = vec![pair.clone()];
        while let Some(last) = pairs.last().filter(|pair| longer(pair) > SIDES[0]) {
            pairs.push(last.map(Image::downsampled));
        }
        let mut found = coarse(&pairs[pairs.len() - 1])?;
        for (i, pair) in pairs.iter().enumerate().rev() {
            if longer(pair) <= SIDES[1] {
                found = finer(pair, &found)?;
            }
            if i > 0 {
                // A pixel of the smaller pair is around every second one of the larger.
                found.iter_mut().flatten().flatten().for_each(|v| *v *= 2.0);
            }
        }
        Ok(found)
    }
}

fn longer(pair: &Pair) -> usize {
    pair.size().0.max(pair.size().1)
}

/// Rough matches of a small pair: those of the first turn by which enough agree, or else the most.
fn coarse(pair: &Pair) -> Result<Vec<Correspondence>> {
    let rows = pair.size().1 / REACH;
    let mut most = Vec::new();
    for turn in TURNS {
        let by = Rectification::turning_right(pair.size(), turn.to_radians())?;
        let found = search(pair, &by, None, CORNERS[0], rows)?;
        match Rectification::roughly(&found, pair.size()) {
            Err(Error::Rectification(RectificationError::Few { .. })) => {
                if found.len() > most.len() {
                    most = found;
                }
            }
            _ => return Ok(found),
        }
    }
    Ok(most)
}

/// Matches of `pair` that are found once it is rectified by rough ones.
fn finer(pair: &Pair, rough: &[Correspondence]) -> Result<Vec<Correspondence>> {
    let (by, agreeing) = Rectification::roughly(rough, pair.size())?;
    search(pair, &by, range(&by, &agreeing), CORNERS[1], ROWS)
}

/// Matches of `pair`, searched in what `by` makes of it: about so many `corners`, each up to `rows` above and below.
fn search(
    pair: &Pair,
    by: &Rectification,
    range: Option<DisparityRange>,
    corners: usize,
    rows: usize,
) -> Result<Vec<Correspondence>> {
    let (width, height) = by.size();
    let found = matches::search(&by.apply(pair)?, None, range, width * height / corners, rows);
    let ends = |m: &Match| {
        let [right, down] = [-m.disparity, m.dy].map(|v| f64::from(v) / f64::from(FRACTION));
        let (x, y) = (m.x as f64, m.y as f64);
        Some([by.left(x, y)?, by.right(x + right, y + down)?])
    };
    Ok(found.iter().filter_map(ends).collect())
}

/// The disparities of `matches` in rectified views, and some beside.
fn range(by: &Rectification, matches: &[Correspondence]) -> Option<DisparityRange> {
    let disparities = || matches.iter().map(|of| by.rectified(0, of[0])[0] - by.rectified(1, of[1])[0]);
    let (least, most) =
        (disparities().fold(f64::INFINITY, f64::min), disparities().fold(f64::NEG_INFINITY, f64::max));
    let margin = MARGIN.0 + MARGIN.1 * (most - least);
    DisparityRange::new((least - margin).floor() as i32, (most + margin).ceil() as i32).ok()
}
