//! Detects parts of a pair that differ from the rest, which statistics of the whole do not show.

use super::matches::{Corner, Survey};
use crate::image::{Image, Plane};
use std::fmt;
use std::ops::Range;

/// Bands that the views are divided into along each side.
const BANDS: usize = 8;
/// Difference across two pixels from which on a pixel has texture, in 1/256 of a level.
const TEXTURE: u16 = 2 << 8;
/// A band has texture if more than one in this many of its pixels have (open).
const TEXTURED: u64 = 50;
/// Percentage of the pixels with texture that are equal in both views from which on a band counts as copied
/// (open). Of 68 sound pairs, no band has more than 12; a copy has 100.
const COPIED_PERCENT: u64 = 60;
/// Distance over which contrast is measured, in pixels: blur does not affect it.
const FAR: usize = 8;
/// Second differences of grey that count as no detail, in 1/256 of a level: rounding causes as much.
const ROUNDING: f64 = 512.0;
/// Ratio of the detail of a band between the views from which on one is blurred or covered (open). Of 68 sound pairs, one out
/// of focus by 5 x 5 pixels among them, none has more than 2.4; blur with a sigma of 2 gives at least 4.3, of 4 gives 20.
const SHARPER: f64 = 4.0;
/// A band with less than this share of the view's mean detail is plain.
const PLAIN: f64 = 1.0 / 8.0;
/// Corners below this share of the median strength of those that were found may be noise on a plain surface.
const FAINT: f64 = 0.25;
/// Share of corners that are found by chance in unrelated views.
const CHANCE: f64 = 0.03;
/// The smallest doubtful part, one in this many rows, and the fewest corners in it.
const LEAST: (usize, usize) = (6, 20);
/// Logarithm of the odds from which on rows are reported as unrelated (open). Of 68 sound pairs, one with a
/// repetitive pattern has 19.1; the others have at most 13.3.
const ODDS: f64 = 20.0;

/// A part of both views: rows over the full width, or columns over the full height.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The whole view.
    Whole,
    /// Some rows.
    Rows {
        /// The first one.
        first: usize,
        /// The last one.
        last: usize,
        /// The number of rows of the views.
        of: usize,
    },
    /// Some columns.
    Columns {
        /// The first one.
        first: usize,
        /// The last one.
        last: usize,
        /// The number of columns of the views.
        of: usize,
    },
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Whole => f.write_str("everywhere"),
            Self::Rows { first, last, of } => write!(f, "in rows {first} to {last} of {of}"),
            Self::Columns { first, last, of } => write!(f, "in columns {first} to {last} of {of}"),
        }
    }
}

/// The longest run of bands with a true value, if there is any.
fn longest(are: [bool; BANDS]) -> Option<Range<usize>> {
    let run = |first: usize| first..(first..BANDS).find(|i| !are[*i]).unwrap_or(BANDS);
    (0..BANDS).map(run).max_by_key(|run| (run.len(), BANDS - run.start)).filter(|run| !run.is_empty())
}

/// The first and the last pixel of these bands, along a side of `of` pixels.
fn pixels(bands: &Range<usize>, of: usize) -> [usize; 2] {
    [bands.start * of / BANDS, bands.end * of / BANDS - 1]
}

fn rows(bands: &Range<usize>, of: usize) -> Part {
    let [first, last] = pixels(bands, of);
    if bands.len() == BANDS { Part::Whole } else { Part::Rows { first, last, of } }
}

/// The part with the same pixels in both views. Only pixels with texture count, as black and white areas are equal in both.
pub(super) fn copied(left: &Image, right: &Image) -> Option<Part> {
    let (width, height) = left.pixels.size();
    if width < BANDS || height < BANDS {
        return None;
    }
    // For each cell, the pixels with texture, and those of them that are equal.
    let mut cells = [[[0_u64; 2]; BANDS]; BANDS];
    for y in 0..height {
        let views = [left.pixels.row(y), right.pixels.row(y)];
        let masks = [left.masked.row(y), right.masked.row(y)];
        let cells = &mut cells[y * BANDS / height];
        for x in 1..width - 1 {
            let texture = views[0][x + 1][3].abs_diff(views[0][x - 1][3]);
            if texture >= TEXTURE && !masks[0][x] && !masks[1][x] {
                let [textured, equal] = &mut cells[x * BANDS / width];
                *textured += 1;
                *equal += u64::from(views[0][x] == views[1][x]);
            }
        }
    }
    let least = (width * height / BANDS) as u64 / TEXTURED;
    let is_copied = |cells: [[u64; 2]; BANDS]| {
        let [textured, equal] = [0, 1].map(|i| cells.iter().map(|cell| cell[i]).sum::<u64>());
        textured > least && 100 * equal >= COPIED_PERCENT * textured
    };
    let down = longest(cells.map(is_copied));
    let across = longest(std::array::from_fn(|i| is_copied(cells.map(|row| row[i]))));
    match (down, across) {
        (Some(down), across) if across.as_ref().is_none_or(|across| across.len() <= down.len()) => {
            Some(rows(&down, height))
        }
        (_, across) => across.map(|across| {
            let [first, last] = pixels(&across, width);
            Part::Columns { first, last, of: width }
        }),
    }
}

/// Detail of each band of rows of a view.
struct Detail {
    bands: [f64; BANDS],
}

impl Detail {
    /// Mean second difference of grey beyond `rounding`, relative to the `contrast`; 0 if most is `masked`.
    fn of(image: &Image, masked: &Plane<bool>, contrast: f64, rounding: f64) -> Self {
        let (width, height) = image.pixels.size();
        let mut bands = [(0.0, 0); BANDS];
        for y in 0..height {
            let (row, masked) = (image.pixels.row(y), masked.row(y));
            let (sum, count) = &mut bands[y * BANDS / height];
            for (pixels, masked) in row.windows(3).zip(masked.windows(3)) {
                if !masked.contains(&true) {
                    let [before, at, after] = [0, 1, 2].map(|i| i32::from(pixels[i][3]));
                    *sum += (f64::from((before - 2 * at + after).abs()) - rounding).max(0.0);
                    *count += 1;
                }
            }
        }
        let mean = |(sum, count): (f64, usize)| {
            if 2 * BANDS * count < width * height { 0.0 } else { sum / (count as f64 * contrast) }
        };
        Self { bands: bands.map(mean) }
    }

    /// The bands with far more detail than those of the `other` view that are not plain.
    fn is_more(&self, other: &Self) -> [bool; BANDS] {
        let mean = self.bands.iter().sum::<f64>() / BANDS as f64;
        std::array::from_fn(|i| self.bands[i] > SHARPER * other.bands[i] && self.bands[i] > PLAIN * mean)
    }
}

/// The mean difference of grey over [`FAR`] pixels; `None` if it is 0.
fn contrast(image: &Image, masked: &Plane<bool>) -> Option<f64> {
    let (mut sum, mut count) = (0_u64, 0_u64);
    for y in 0..image.pixels.height() {
        let (row, masked) = (image.pixels.row(y), masked.row(y));
        for x in FAR..row.len() {
            if !masked[x] && !masked[x - FAR] {
                sum += u64::from(row[x][3].abs_diff(row[x - FAR][3]));
                count += 1;
            }
        }
    }
    (sum > 0).then(|| sum as f64 / count as f64)
}

/// The view, left (0) or right (1), that is blurred or covered in a part where the other has detail.
pub(super) fn blurred(left: &Image, right: &Image) -> Option<(usize, Part)> {
    let (width, height) = left.pixels.size();
    // Pixels masked in one view do not count in the other either.
    let masks = left.masked.data().iter().zip(right.masked.data());
    let masked = Plane::new(width, height, masks.map(|(left, right)| left | right).collect());
    let contrasts = [contrast(left, &masked)?, contrast(right, &masked)?];
    let detail = |image: &Image, i: usize| {
        // Scale the rounding to the same share of the contrast in both views.
        let rounding = ROUNDING * (contrasts[i] / contrasts[1 - i]).max(1.0);
        Detail::of(image, &masked, contrasts[i], rounding)
    };
    let [left, right] = [detail(left, 0), detail(right, 1)];
    let [of_left, of_right] = [right.is_more(&left), left.is_more(&right)].map(longest);
    let found = [of_left.map(|bands| (0, bands)), of_right.map(|bands| (1, bands))].into_iter().flatten();
    let (view, bands) = found.max_by_key(|(_, bands)| bands.len())?;
    Some((view, rows(&bands, height)))
}

/// The rows that are hardly found on the same rows of the right view, unlike the rest. Faint corners do not
/// count. `masked` is the mask of the right view.
///
/// They are the rows with the largest likelihood ratio of two hypotheses: their corners are found by chance,
/// or as often as all corners.
pub(super) fn strange(survey: &Survey, masked: &Plane<bool>, most_rows: u32) -> Option<Part> {
    let (width, height) = masked.size();
    let found = |corner: &&Corner| corner.offset.is_some_and(|dy| dy <= most_rows);
    let mut strengths: Vec<f64> = survey.corners.iter().filter(found).map(|corner| corner.strength).collect();
    strengths.sort_unstable_by(f64::total_cmp);
    let least = FAINT * strengths.get(strengths.len() / 2)?;
    // Rows that are mostly masked in the right view cannot be found.
    let is_seen = |y: usize| 2 * masked.row(y).iter().filter(|masked| **masked).count() < width;
    let seen: Vec<bool> = (0..height).map(is_seen).collect();
    let strong: Vec<_> = survey.corners.iter().filter(|c| c.strength >= least && seen[c.y]).collect();
    let share = strong.iter().filter(|corner| found(corner)).count() as f64 / strong.len() as f64;
    if share <= CHANCE || share >= 1.0 {
        return None;
    }
    let odds = [((1.0 - CHANCE) / (1.0 - share)).ln(), (CHANCE / share).ln()];
    let (mut best, mut sum, mut start, mut rows) = (ODDS, 0.0, 0, None);
    for (i, corner) in strong.iter().enumerate() {
        if sum <= 0.0 {
            (sum, start) = (0.0, i);
        }
        sum += odds[usize::from(found(corner))];
        let (first, last) = (strong[start].y, corner.y);
        if sum > best && LEAST.0 * (last - first) >= height && i - start >= LEAST.1 {
            (best, rows) = (sum, Some(Part::Rows { first, last, of: height }));
        }
    }
    rows
}
