//! Warnings about probable mistakes. Before a pair is matched they come from its pixels and from sparse matches, after a match from its
//! maps.

use super::matches::{self, SparseMatch, Survey};
use super::parts::{self, Part};
use crate::image::{Image, Orientation, Pair};
use crate::maps::{FRACTION, Maps, flag};
use crate::options::DisparityRange;
use crate::prior::PriorUse;

/// Fewer matches than this give no statistics.
pub(super) const MIN_MATCHES: usize = 30;
/// Approximate number of corners that [`warnings`] looks for: its statistics need no more.
const SAMPLE: usize = 300;
/// Number of rows above and below its own on which [`warnings`] looks for a corner.
const ROWS: usize = 8;
/// Largest median of |dy| in a rectified pair, in 1/256 px (open): half a pixel. Of 60 pairs that count as
/// rectified (indoors, from cars, from the air, rendered), none has more than 0.40 px; with one view shifted
/// down by one pixel, all have 0.61 px or more.
const MAX_OFFSET: u32 = FRACTION as u32 / 2;
/// A corner found farther than this above or below its row, in 1/256 px, is off its row.
const MAX_APART: u32 = 3 * FRACTION as u32 / 2;
/// Percentage of matches with the wrong sign from which on the views count as swapped.
const SWAPPED_PERCENT: usize = 90;
/// A view counts as plain when nearly all of its grey lies within this many 8-bit levels, noise included.
const PLAIN_LEVELS: usize = 4;
/// Smallest contrast of a view, in percent of the other's (open). At a fifth of the contrast, the share of
/// bad pixels grows by a factor of 1.3 in the median of 18 pairs, and by 2.9 at most, on plain surfaces,
/// whose texture falls between the levels. The original pairs have 72 to 100 %.
const CONTRAST_PERCENT: usize = 25;
/// Difference between the views in their percentage of black or white pixels from which on the exposures count
/// as far apart (open). In the median of
/// 18 pairs made brighter or darker, a difference of 10 to 15 multiplies the share of bad pixels by 1.5, and
/// by 2.4 at most; 15 to 30 by 1.8 and 3.5; below 5 by 1.2 and 1.7. The original pairs differ by 0.5 at most.
const SATURATED_PERCENT: usize = 10;
/// Percentage of measured pixels at an end of the range from which on the range counts as too narrow (open).
/// Of 76 ranges that cut off 4 % or more of the truth of 18 pairs, 75 have more. Of 55 ranges that hold the
/// truth, one has more: it ends in the middle of a wall, within half a pixel of the truth. The others have
/// 2.0 at most, and 0.13 with the range of the calibration.
const CLIPPED_PERCENT: usize = 2;
/// The views count as hardly matching below this percentage of unmasked pixels found in both views (open). Of
/// 52 sound pairs (rooms, roads, from a robot, from the air and from space), the least has 53 with one look
/// and with `fast`, and 42 with `fgs`. Of the same 52 with a view of another scene, one inverted, one of
/// noise, and one 20 rows off, 202 of 208 have less than this with one look, and 194 with `fast`.
const MEASURED_PERCENT: usize = 35;
/// After a second look, only pixels with at least this confidence count as found in both views (open). Guesses
/// make pixels agree by chance: of two views of noise with 16 labels, 49 % agree, but 28 % with this
/// confidence (26 % with one look). Sound pairs have 54 % or more with it, rendered ones with plain walls 50 %
/// (small parts of a wall 36 %), and 16 rendered pairs with an inverted view 10 to 35 %.
const FOUND_CONFIDENCE: u8 = 20;
/// Percentage of masked pixels from which on the mask is to blame if few of the others are found (open).
const MASKED_PERCENT: usize = 50;
/// The trust in a prior from which on it goes without a warning.
const TRUSTED: f64 = 0.9;
/// Ranges with fewer labels consist of ends only.
pub(super) const MIN_LABELS: usize = 3;

/// A likely fault of a pair. It displays as one line with the cause, and with the remedy unless that depends
/// on the front end.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Warning {
    /// An image file is damaged, but its decoder could recover.
    #[error("{doubt}; a part of the image may be wrong: get the file again")]
    Damaged {
        /// The name of the file, and the damage.
        doubt: String,
    },
    /// The files tag their images as rotated, and they were not turned upright.
    #[error(
        "{} stored turned, as the EXIF or TIFF tag for orientation says, and used as stored",
        ["the left image is", "the right image is", "both images are"][*which]
    )]
    Oriented {
        /// The left image (0), the right one (1) or both (2).
        which: usize,
    },
    /// Both views have the same pixels.
    #[error("the two images are the same, so they show no depth: give the right view as the second")]
    Identical,
    /// All pixels of a view are masked.
    #[error("the {view} view is masked everywhere, so nothing in it can be matched")]
    Masked {
        /// Name of the view: "left" or "right".
        view: &'static str,
    },
    /// A view has almost no contrast.
    #[error(
        "the {view} view is all one colour, so nothing in it can be matched: check that it is the right image and well \
         exposed"
    )]
    Plain {
        /// Name of the view: "left" or "right".
        view: &'static str,
    },
    /// Both views have the same pixels in a part.
    #[error(
        "both views hold the same pixels {part}, so there is no depth there: a part of one view was copied into the other; check the \
         program that wrote the images"
    )]
    Copied {
        /// The part.
        part: Part,
    },
    /// A view lacks the detail of the other one.
    #[error(
        "the {view} view has far less detail than the other {part}, so little can be matched there: check that it is in focus, that \
         nothing covers the camera, and that the detail of the other view is not just noise"
    )]
    Blurred {
        /// Name of the view: "left" or "right".
        view: &'static str,
        /// The part.
        part: Part,
    },
    /// Almost nothing of some rows was found, unlike the other rows.
    #[error(
        "hardly anything {part} of the left view is found on the same rows of the right one, unlike elsewhere: check that no image is \
         torn there, and that both were taken at the same moment"
    )]
    Torn {
        /// The rows.
        part: Part,
    },
    /// One view has far less contrast than the other.
    #[error(
        "the exposures are far apart: one view has {percent} % of the other's contrast: expose both alike, or give images \
         with 16 bits"
    )]
    Contrast {
        /// Its contrast in percent of the other's.
        percent: usize,
    },
    /// One view has far more black or white pixels than the other.
    #[error(
        "the exposures are far apart: {} % of the left view and {} % of the right one are black or white, where nothing \
         can be matched",
        percent[0],
        percent[1]
    )]
    Saturated {
        /// Black and white pixels of the left and the right view, in percent of all.
        percent: [usize; 2],
    },
    /// One view is turned or mirrored relative to the other.
    #[error(
        "one of the views is {how} compared with the other: turn it back, so that both views have the same orientation"
    )]
    Turned {
        /// How: "upside down", "mirrored", "turned by half a turn" or "turned by a quarter".
        how: &'static str,
    },
    /// Matches lie on the same column.
    #[error(
        "matches lie on the same column instead of the same row: both images are turned by 90 degrees, or one camera was \
         above the other; turn both images by 90 degrees"
    )]
    Sideways,
    /// Matches do not lie on the same row.
    #[error(
        "the pair is not rectified: matches lie {:.1} px above or below their row",
        f64::from(*offset) / f64::from(FRACTION)
    )]
    NotRectified {
        /// The median of |dy| over the matches, in 1/256 px.
        offset: u32,
    },
    /// Nearly everything is further right in the right view.
    #[error("the views seem to be swapped: {percent} % of the matches have negative disparities")]
    Swapped {
        /// Matches with negative disparities, in percent of all.
        percent: usize,
    },
    /// Few pixels of the left view were found in the right one.
    #[error(
        "only {percent} % of the pixels were found in both views, and all others are guessed from these: check that both show \
         the same scene at the same moment, that they are rectified, and that neither is turned or a negative"
    )]
    HardlyMatch {
        /// Pixels that were found, in percent of those that are not masked.
        percent: usize,
    },
    /// Few of the pixels outside a large mask were found in the right view.
    #[error(
        "only {percent} % of the pixels that the mask leaves were found in both views; it covers {masked} % of the left view: check that \
         it covers what is to be ignored, and not the scene"
    )]
    LittleLeft {
        /// Pixels that were found, in percent of those that are not masked.
        percent: usize,
        /// Masked pixels of the left view, in percent of all.
        masked: usize,
    },
    /// Many disparities are at an end of the range.
    #[error(
        "{percent} % of the measured pixels are at disparity {end}, an end of the range, which probably cuts off part of \
         the scene"
    )]
    Clipped {
        /// The end, in pixels of disparity.
        end: i32,
        /// Whether it is the upper end.
        upper: bool,
        /// Pixels at that end, in percent of all measured ones.
        percent: usize,
    },
    /// The images contradict what was known of the scene.
    #[error(
        "the images contradict the prior{}",
        match percent {
            0 => ", so it was not used: check that it is of this scene, in pixels of disparity".to_owned(),
            percent => format!(" in part, so it counts {percent} %"),
        }
    )]
    Contradicted {
        /// How much the prior counts, in percent; 0 if it was not used.
        percent: usize,
    },
}

impl Warning {
    /// Whether no range helps, because the pair itself is at fault.
    pub(super) fn is_beyond_range(&self) -> bool {
        !matches!(
            self,
            Self::Contrast { .. } | Self::Saturated { .. } | Self::Blurred { .. } | Self::Clipped { .. }
        )
    }
}

/// The likely faults of `pair`, the likeliest cause first; empty if there are none or too few matches to
/// tell. `range` is the range that the user asked for, if any.
///
/// Corners are searched in both directions along the row, up to half the width, and up to 8 rows away from
/// it.
///
/// - Damaged: an image file is damaged, but could be decoded.
/// - Oriented: the tag of a file says that its image is stored rotated.
/// - Masked: all pixels of a view are masked.
/// - Plain: nearly all grey of a view is within 4 levels of 8 bits. No other warning is given then.
/// - Contrast, saturated: gain and offset between the views are harmless by themselves, because the matching
///   cost uses a census. Detail that falls between the levels or is clipped at either end is lost. Contrast
///   is the span of the middle 90 % of grey.
/// - Copied: in a part of at least an eighth, most pixels with texture are equal in both views.
/// - Blurred: in a part of at least an eighth of the rows, a view has less than a quarter of the other's fine
///   detail, relative to the contrast of the whole.
/// - Torn: corners of at least a sixth of the rows are found on their row in the right view no more often than
///   by chance, and elsewhere far more often. Faint corners do not count: a plain wall or the sky has no others.
/// - Turned: there are hardly any matches, but many after turning the right view.
/// - Sideways: matches along rows are few or not rectified, and those along columns are not.
/// - Not rectified: the median of |dy| exceeds half a pixel. This needs half of the matches to be off, in
///   whichever direction (a rotation moves the two sides in opposite directions), so a few false matches do
///   not matter.
/// - Swapped: nine in ten matches of a rectified pair are more than a pixel below 0. Converging cameras may
///   cause that too; a user who gives a range with negative disparities knows, and is not warned. In an
///   unrectified pair, rotated cameras decide the sign of disparities.
///
/// Without enough memory for the search, only the checks before it are made, up to the copied parts.
#[must_use]
pub fn warnings(pair: &Pair, range: Option<DisparityRange>) -> Vec<Warning> {
    let mut out = damaged(pair);
    out.extend(oriented(pair));
    out.extend(of_pixels(pair, range));
    out
}

/// [`Warning::Damaged`] for the files of `pair`, once if both views are from one file. Reads no pixels.
#[must_use]
pub fn damaged(pair: &Pair) -> Vec<Warning> {
    let mut doubts: Vec<_> = pair.doubts().iter().flatten().collect();
    doubts.dedup();
    doubts.into_iter().map(|doubt| Warning::Damaged { doubt: doubt.clone() }).collect()
}

/// Whether the images are stored rotated.
fn oriented(pair: &Pair) -> Option<Warning> {
    let which = match pair.orientations().map(Orientation::is_upright) {
        [true, true] => return None,
        [false, true] => 0,
        [true, false] => 1,
        [false, false] => 2,
    };
    Some(Warning::Oriented { which })
}

/// All warnings that depend on pixel values (everything but `Damaged` and `Oriented`).
pub(super) fn of_pixels(pair: &Pair, range: Option<DisparityRange>) -> Vec<Warning> {
    let tones = [("left", pair.left()), ("right", pair.right())]
        .map(|(view, image)| (view, Tones::of(image, |x, y| !image.masked[(x, y)])));
    let masked = tones.iter().filter(|(_, tones)| tones.is_none());
    let masked: Vec<_> = masked.map(|(view, _)| Warning::Masked { view }).collect();
    if !masked.is_empty() {
        return masked;
    }
    let plain = tones.iter().filter(|(_, tones)| tones.as_ref().is_some_and(|t| t.nearly_all < PLAIN_LEVELS));
    let plain: Vec<_> = plain.map(|(view, _)| Warning::Plain { view }).collect();
    if !plain.is_empty() {
        return plain;
    }
    if identical(pair.left(), pair.right()) {
        return vec![Warning::Identical];
    }
    let (width, height) = pair.size();
    let survey = |pair: &Pair| matches::survey(pair, None, None, width * height / SAMPLE, ROWS);
    let is_searched = matches::check_memory(pair).is_ok();
    let found = if is_searched { survey(pair) } else { Survey::default() };
    let mut out = exposure(pair, matches::median(found.matches.iter().map(|m| m.disparity)) / FRACTION);
    let is_exposed_alike = out.is_empty();
    let copied = parts::copied(pair.left(), pair.right());
    out.extend(copied.map(|part| Warning::Copied { part }));
    if !is_searched {
        return out;
    }
    // The median of |dy|; `None` if there are too few matches.
    let offset = |found: &[SparseMatch]| {
        let offset = || matches::median(found.iter().map(|m| m.dy.abs())).unsigned_abs();
        (found.len() >= MIN_MATCHES).then(offset)
    };
    let sideways = || {
        let pair = Pair::new(pair.left().transposed(), pair.right().transposed()).ok()?;
        offset(&survey(&pair).matches).filter(|offset| *offset <= MAX_OFFSET)
    };
    match offset(&found.matches) {
        Some(offset) if offset <= MAX_OFFSET => {
            let disparities = found.matches.iter().map(|m| m.disparity);
            let percent = 100 * disparities.filter(|d| *d < -FRACTION).count() / found.matches.len();
            if percent >= SWAPPED_PERCENT && range.is_none_or(|r| r.min >= 0) {
                out.push(Warning::Swapped { percent });
            }
        }
        _ if sideways().is_some() => {
            out.push(Warning::Sideways);
            return out;
        }
        Some(offset) => out.push(Warning::NotRectified { offset }),
        None => {
            let right = pair.right();
            let ways: [(&str, &dyn Fn() -> Image); 5] = [
                ("upside down", &|| right.flipped()),
                ("mirrored", &|| right.mirrored()),
                ("turned by half a turn", &|| right.flipped().mirrored()),
                ("turned by a quarter", &|| right.transposed().mirrored()),
                ("turned by a quarter", &|| right.transposed().flipped()),
            ];
            let matches = |view: Image| {
                let turned = Pair::new(pair.left().clone(), view).ok()?;
                offset(&survey(&turned).matches)
            };
            if let Some((how, _)) = ways.into_iter().find(|(_, view)| matches(view()).is_some()) {
                out.push(Warning::Turned { how });
                return out;
            }
        }
    }
    if copied.is_none() {
        // Very different exposures also cost one view its detail.
        let blurred = is_exposed_alike.then(|| parts::blurred(pair.left(), pair.right())).flatten();
        let blurred = blurred.map(|(view, part)| Warning::Blurred { view: ["left", "right"][view], part });
        let torn = || {
            let is_rectified = offset(&found.matches).is_some_and(|offset| offset <= MAX_OFFSET);
            let part = parts::strange(&found, &pair.right().masked, MAX_APART).filter(|_| is_rectified)?;
            Some(Warning::Torn { part })
        };
        out.extend(blurred.or_else(torn));
    }
    out
}

/// The likely faults of a match over `range` that gave `maps` after this number of
/// [`looks`](crate::options::ScheduleOptions::looks).
///
/// - Hardly match: fewer than 35 % of the unmasked pixels were found in both views. After a second look, only
///   pixels with a confidence of at least 20 count. If at least half of the left view is masked, the warning is
///   "little left": pixels next to masked ones are often not found, nor are those whose match is outside the
///   right view. No other warning is given then.
/// - Clipped: many disparities are at an end of the range, so it probably cuts off part of the scene. A lower
///   end of 0, the horizon of parallel cameras, does not count.
#[must_use]
pub fn warnings_of(maps: &Maps, range: DisparityRange, looks: u32) -> Vec<Warning> {
    let least = if looks > 1 { FOUND_CONFIDENCE } else { 0 };
    let pixels = || maps.raw.data().iter().zip(maps.validity.data()).zip(maps.confidence.data());
    let known = pixels().filter(|((_, v), _)| *v & flag::MASKED == 0).count();
    let (mut all, mut sure, mut at) = (0, 0, [0; 2]);
    for ((disparity, _), confidence) in pixels().filter(|((_, v), _)| *v & flag::INVALID == 0) {
        all += 1;
        sure += usize::from(*confidence >= least);
        at[0] += usize::from(*disparity <= range.min * FRACTION);
        at[1] += usize::from(*disparity >= range.max * FRACTION);
    }
    if 100 * sure < MEASURED_PERCENT * known {
        let (percent, masked) = (100 * sure / known, 100 - 100 * known / maps.raw.data().len());
        return vec![if masked >= MASKED_PERCENT {
            Warning::LittleLeft { percent, masked }
        } else {
            Warning::HardlyMatch { percent }
        }];
    }
    let ends = [(range.min, false, at[0]), (range.max, true, at[1])];
    ends.into_iter()
        .filter(|(end, upper, _)| range.labels() >= MIN_LABELS && (*upper || *end != 0))
        .filter(|(.., count)| 100 * count > CLIPPED_PERCENT * all)
        .map(|(end, upper, count)| Warning::Clipped { end, upper, percent: 100 * count / all })
        .collect()
}

/// The warnings of [`warnings_of`], and that of a `prior` that the images contradict. If sparse matches have found the range
/// (`range_found`), disparities at its lower end are errors, since distant surfaces have sparse matches: they give no warning.
#[must_use]
pub fn warnings_of_match(
    maps: &Maps,
    range: DisparityRange,
    looks: u32,
    range_found: bool,
    prior: Option<&PriorUse>,
) -> Vec<Warning> {
    let mut warnings = warnings_of(maps, range, looks);
    warnings.retain(|w| !range_found || !matches!(w, Warning::Clipped { upper: false, .. }));
    warnings.extend(prior.and_then(of_prior));
    warnings
}

/// The warning of a prior that the images contradict.
fn of_prior(used: &PriorUse) -> Option<Warning> {
    (used.trust < TRUSTED).then(|| Warning::Contradicted { percent: (100.0 * used.trust).round() as usize })
}

/// Statistics of the grey of a view, in 8-bit levels.
struct Tones {
    /// Span of the middle 98 % of its pixels.
    nearly_all: usize,
    /// Span of the middle 90 %.
    contrast: usize,
    /// Pixels that are black or white, in percent.
    saturated: usize,
}

impl Tones {
    /// The statistics of the pixels that `count`; `None` if there are none.
    fn of(image: &Image, count: impl Fn(usize, usize) -> bool) -> Option<Self> {
        let (width, height) = image.pixels.size();
        let mut counts = [0_usize; 256];
        for y in 0..height {
            let row = image.pixels.row(y);
            (0..width).filter(|x| count(*x, y)).for_each(|x| counts[usize::from(row[x][3] >> 8)] += 1);
        }
        let all: usize = counts.iter().sum();
        // The lowest level with more than this percentage of the pixels at or below it.
        let level = |percent: usize| {
            let mut below = 0;
            counts.iter().position(|count| {
                below += count;
                100 * below > percent * all
            })
        };
        let span = |outside: usize| Some(level(100 - outside)? - level(outside)?);
        let saturated = [0, 1, 254, 255].map(|level| counts[level]).iter().sum::<usize>();
        Some(Self { nearly_all: span(1)?, contrast: span(5)?, saturated: 100 * saturated / all })
    }
}

/// Warns if one view lacks detail of the other because their exposures differ. `disparity` is a typical one,
/// in pixels: pixels masked in one view do not count in the other either.
fn exposure(pair: &Pair, disparity: i32) -> Vec<Warning> {
    let of = |image: &Image, other: &Image, right: i32| {
        Tones::of(image, |x, y| {
            let there = x as i32 + right;
            let hidden = (0..other.width() as i32).contains(&there) && other.masked[(there as usize, y)];
            !image.masked[(x, y)] && !hidden
        })
    };
    let [left, right] = [pair.left(), pair.right()];
    let (Some(left), Some(right)) = (of(left, right, -disparity), of(right, left, disparity)) else {
        return Vec::new();
    };
    let mut out = Vec::new();
    let (less, more) = (left.contrast.min(right.contrast), left.contrast.max(right.contrast));
    if 100 * less < CONTRAST_PERCENT * more {
        out.push(Warning::Contrast { percent: 100 * less / more });
    }
    if left.saturated.abs_diff(right.saturated) >= SATURATED_PERCENT {
        out.push(Warning::Saturated { percent: [left.saturated, right.saturated] });
    }
    out
}

/// Whether some pixels are unmasked in both views, and all of them are equal.
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
