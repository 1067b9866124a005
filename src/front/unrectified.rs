//! Rectifies a pair by its own matches: from a coarse search of the whole image to a fine one along rows.

use super::matches::{self, SparseMatch};
use crate::error::{Error, RectificationError, Result};
use crate::image::{Image, Pair};
use crate::maps::FRACTION;
use crate::options::DisparityRange;
use crate::rectification::{Correspondence, Options, Rectification};

/// The largest sides, in pixels, of the pairs for the coarse and the fine search (open).
const SIDES: [usize; 2] = [320, 1600];
/// The coarse search covers 1 / `REACH` of the height above and below.
const REACH: usize = 3;
/// Angles in degrees by which the right view is rotated for the coarse search, one after the other, until
/// enough matches agree: windows still look alike at rotations of about 10 degrees.
const TURNS: [f64; 5] = [0.0, 12.0, -12.0, 24.0, -24.0];
/// Rows above and below that are searched in a nearly rectified pair.
const ROWS: usize = 4;
/// Approximate number of corners in the coarse search, and in the others.
const CORNERS: [usize; 2] = [1024, 4096];
/// The range is extended by this many pixels and this share of its span on both sides.
const MARGIN: (f64, f64) = (4.0, 0.125);

impl Rectification {
    /// The rectification of `pair` by its own matches, like [`Rectification::of_matches`]: for two
    /// photographs of one camera that was moved to the side. It may have rotated by some degrees up or to a
    /// side, and by up to about 30 about its axis. Masked pixels do not count.
    ///
    /// Corners of the left image are first searched in a smaller pair, far in all directions. Then the pair
    /// is rectified by these matches, and the corners are searched again along the rows, where rotated views
    /// look alike. That is repeated at twice the size, up to 1600 pixels.
    ///
    /// # Errors
    /// The errors of [`Rectification::of_matches`]; [`Error::Memory`] if the machine has too little.
    pub fn of_pair(pair: &Pair, options: &Options) -> Result<Self> {
        Self::of_matches(&Self::matches_of(pair)?, pair.size(), options)
    }

    /// The matches by which [`Rectification::of_pair`] rectifies `pair`.
    ///
    /// # Errors
    /// The errors of [`Rectification::of_pair`] that concern matches.
    pub fn matches_of(pair: &Pair) -> Result<Vec<Correspondence>> {
        matches::check_memory(pair)?;
        // The pair at 1, 1/2, 1/4 of its size and so on.
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
                // Pixels of the smaller pair are centred on every second one of the larger.
                found.iter_mut().flatten().flatten().for_each(|v| *v *= 2.0);
            }
        }
        Ok(found)
    }
}

fn longer(pair: &Pair) -> usize {
    pair.size().0.max(pair.size().1)
}

/// Rough matches of a small pair: those at the first rotation with enough agreeing ones, or else the most.
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

/// The matches of `pair` after rectification by rough ones.
fn finer(pair: &Pair, rough: &[Correspondence]) -> Result<Vec<Correspondence>> {
    let (by, agreeing) = Rectification::roughly(rough, pair.size())?;
    search(pair, &by, range(&by, &agreeing), CORNERS[1], ROWS)
}

/// Matches of `pair` after rectification: about so many `corners`, searched in `rows` above and below.
fn search(
    pair: &Pair,
    by: &Rectification,
    range: Option<DisparityRange>,
    corners: usize,
    rows: usize,
) -> Result<Vec<Correspondence>> {
    let (width, height) = by.size();
    let found = matches::search(&by.apply(pair)?, None, range, width * height / corners, rows);
    let ends = |m: &SparseMatch| {
        let [right, down] = [-m.disparity, m.dy].map(|v| f64::from(v) / f64::from(FRACTION));
        let (x, y) = (m.x as f64, m.y as f64);
        Some([by.left(x, y)?, by.right(x + right, y + down)?])
    };
    Ok(found.iter().filter_map(ends).collect())
}

/// The disparities of `matches` in rectified views, with a margin.
fn range(by: &Rectification, matches: &[Correspondence]) -> Option<DisparityRange> {
    let disparities = || matches.iter().map(|of| by.rectified(0, of[0])[0] - by.rectified(1, of[1])[0]);
    let (least, most) =
        (disparities().fold(f64::INFINITY, f64::min), disparities().fold(f64::NEG_INFINITY, f64::max));
    let margin = MARGIN.0 + MARGIN.1 * (most - least);
    DisparityRange::new((least - margin).floor() as i32, (most + margin).ceil() as i32).ok()
}
