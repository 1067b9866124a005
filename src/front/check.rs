//! What sparse matches tell before a pair is matched: the range to search, and what is wrong with the pair.

use super::matches;
use crate::image::{Image, Pair};
use crate::maps::FRACTION;
use crate::options::DisparityRange;
use std::fmt;

/// Fewer matches say nothing.
const MIN_MATCHES: usize = 30;
/// Matches at either end of the range that are passed over, as strays: one in this many of all, and one.
const STRAYS: usize = 400;
/// The image is divided into this many parts along each side, to see how much of it bears no match.
const PARTS: usize = 8;
/// Corners that [`warnings`] looks for, about: statistics need no more.
const SAMPLE: usize = 300;
/// Rows above and below its own on which [`warnings`] looks for a corner.
const ROWS: usize = 8;
/// Largest median of |dy| in a rectified pair, in 1/256 px (open): four times that of the worst of ten real pairs that
/// are taken as rectified.
const MAX_OFFSET: u32 = FRACTION as u32;
/// Matches on the wrong side of 0 that betray swapped views, in percent of all.
const SWAPPED_PERCENT: usize = 90;

/// The range of disparities in `pair`, with a margin; `None` where there are too few matches to say.
///
/// The margin is lopsided. The farthest surface is mostly a background that faces the cameras and bears matches: a
/// pixel and 1/24 of the matches' span are enough. The nearest ones are often grounds seen at grazing angles, which
/// look different in the two views and bear none: three pixels and 1/4 of the span. (Open; both are set by five
/// real pairs. Too many labels cost time, too few cost the foreground.)
///
/// Where more than a quarter of the image bears no match, that may be a plain wall behind everything else: the range
/// then reaches down to 0, the horizon of parallel cameras.
#[must_use]
pub fn range(pair: &Pair) -> Option<DisparityRange> {
    let found = matches::find(pair, None, None);
    if found.len() < MIN_MATCHES {
        return None;
    }
    let (width, height) = pair.size();
    let mut bare = [true; PARTS * PARTS];
    for m in &found {
        bare[m.y * PARTS / height * PARTS + m.x * PARTS / width] = false;
    }
    let bare = bare.into_iter().filter(|bare| *bare).count();
    let mut disparities: Vec<i32> = found.iter().map(|m| m.disparity).collect();
    disparities.sort_unstable();
    let strays = disparities.len() / STRAYS + 1;
    let (far, near) = (disparities[strays], disparities[disparities.len() - 1 - strays]);
    let span = near - far;
    let (min, max) = (far - FRACTION - span / 24, near + 3 * FRACTION + span / 4);
    let min = if 4 * bare > PARTS * PARTS { min.min(0) } else { min };
    DisparityRange::new(min.div_euclid(FRACTION), -(-max).div_euclid(FRACTION)).ok()
}

/// What is probably wrong with a pair. Each displays as one line with the cause and the remedy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Warning {
    /// Both views hold the same pixels.
    Identical,
    /// Matches do not lie on the same row.
    NotRectified {
        /// The median of |dy| over the matches, in 1/256 px.
        offset: u32,
    },
    /// Nearly everything lies further right in the right view.
    Swapped {
        /// Matches with negative disparities, in percent of all.
        percent: usize,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Identical => {
                write!(
                    f,
                    "the two images are the same, so there is no depth in them: give the right view as the second"
                )
            }
            Self::NotRectified { offset } => write!(
                f,
                "the pair is not rectified: matches lie {:.1} px above or below their row: rectify it first, by the \
                 calibration of the cameras",
                f64::from(*offset) / f64::from(FRACTION)
            ),
            Self::Swapped { percent } => write!(
                f,
                "the views seem to be swapped: {percent} % of the matches have negative disparities: exchange the \
                 two images, or give a negative --min-disparity if the cameras converge"
            ),
        }
    }
}

/// What is probably wrong with `pair`, the likeliest cause first; nothing where all seems well or there are too few
/// matches to say. `range` is what the user asked to search, if anything.
///
/// Corners are looked for in both directions on the row, up to half the width, and up to 8 rows off it.
///
/// - Not rectified: the median of |dy| exceeds a pixel. So half of the matches must agree, whichever way they are off
///   (a rotation moves both sides apart), and the odd false match is of no consequence.
/// - Swapped: nine in ten matches lie more than a pixel on the negative side. Cameras that converge may do that
///   too; who states a range with negative disparities knows, and is not warned.
#[must_use]
pub fn warnings(pair: &Pair, range: Option<DisparityRange>) -> Vec<Warning> {
    if identical(pair.left(), pair.right()) {
        return vec![Warning::Identical];
    }
    let (width, height) = pair.size();
    let found = matches::search(pair, None, None, width * height / SAMPLE, ROWS);
    let mut out = Vec::new();
    if found.len() < MIN_MATCHES {
        return out;
    }
    let mut offsets: Vec<u32> = found.iter().map(|m| m.dy.unsigned_abs()).collect();
    offsets.sort_unstable();
    let offset = offsets[offsets.len() / 2];
    if offset > MAX_OFFSET {
        out.push(Warning::NotRectified { offset });
    }
    let percent = 100 * found.iter().filter(|m| m.disparity < -FRACTION).count() / found.len();
    if percent >= SWAPPED_PERCENT && range.is_none_or(|r| r.min >= 0) {
        out.push(Warning::Swapped { percent });
    }
    out
}

/// Whether all pixels are equal that neither mask hides, and there are any.
fn identical(left: &Image, right: &Image) -> bool {
    let masks = left.masked.data().iter().zip(right.masked.data());
    let mut seen = left
        .pixels
        .data()
        .iter()
        .zip(right.pixels.data())
        .zip(masks)
        .filter(|(_, (l, r))| !*l && !*r)
        .map(|((l, r), _)| l == r)
        .peekable();
    seen.peek().is_some() && seen.all(|same| same)
}
