//! The range of disparities to search, by sparse matches, and whether the maps of a match suggest a wider one.

use super::matches::{self, SparseMatch};
use super::warnings::{MIN_LABELS, MIN_MATCHES, Warning, of_pixels};
use crate::error::{RangeError, Result};
use crate::image::Pair;
use crate::maps::{FRACTION, Maps, flag};
use crate::options::DisparityRange;
#[cfg(feature = "cameras")]
use crate::rectification::{self, Rectification};

/// Matches at either end of the range that are skipped as outliers: one, plus one in this many of all.
const STRAYS: usize = 400;
/// The image is divided into this many parts along each side, to see how much of it has no match.
const PARTS: usize = 8;
/// Disparities are outliers if they are beyond all but this percentage at either end, by more than the span
/// between these, and [alone](is_alone) (open).
const TAIL_PERCENT: usize = 5;
/// The least distance from them, in pixels, to be an outlier.
const LEAST_BEYOND: i32 = 16;
/// Percentage of matches more than a pixel below 0 from which on the cameras count as converging (open). Of 52 pairs, two of satellites
/// have more than half there and one of a robot has 2.5; the others, whose truth is above 0, have at most 1.0, many of them false.
const BELOW_PERCENT: usize = 1;
/// A range that sparse matches found is made [`wider`] if more than this many pixels per thousand lie at its upper
/// end (open). Of 54 ranges, two cut off a road: these have 11 and 12 with `default`, 23 and 25 with `fast`. With
/// `fast`, three of the others have more than 8 (one of them lacks the nearest 3 px), and 47 less than 4.
const ENDING: usize = 8;

/// The range of disparities in `pair`, with a margin.
///
/// The margin is larger at the near end. The farthest surface is mostly a background that faces the cameras
/// and has matches, so one pixel plus 1/24 of the matches' span is enough. The nearest surfaces are often
/// grounds seen at grazing angles, which look different in the two views and have no matches: the margin is
/// three pixels plus 1/4 of the span. (Open; both were set on five real pairs. Too many labels cost time, too
/// few cost the foreground.)
///
/// Parallel cameras see nothing below 0. Negative disparities are searched only if more than one match in a hundred is below -1.
///
/// Where more than a quarter of the image has no match, that part may be a plain wall behind everything else.
/// The range then extends down to 0, the horizon of parallel cameras.
///
/// Matches that are far from all others, in the image or in disparity, do not count.
///
/// # Errors
/// [`RangeError::NotRectified`] when the pair has too few matches, but enough after rectification by its own (with the
/// feature `cameras`);
/// [`RangeError::NotFound`] when it has too few in any case, with the warning if one explains that;
/// [`Error::Memory`](crate::Error::Memory) when the machine has too little memory for the search.
pub fn range(pair: &Pair) -> Result<DisparityRange> {
    range_from(pair, None)
}

/// The range of a pair whose cameras are known: points in front of them have disparities above -`doffs`, the
/// distance of their principal points along the row, in pixels. The range begins there at the least, and
/// matches behind the cameras do not count, unless most are there: then the pair is not of these cameras.
///
/// # Errors
/// The errors of [`range`].
pub fn range_of_cameras(pair: &Pair, doffs: f64) -> Result<DisparityRange> {
    range_from(pair, Some(-doffs))
}

/// The range of the matches; if `least` is given, only of those with at least this disparity.
fn range_from(pair: &Pair, least: Option<f64>) -> Result<DisparityRange> {
    matches::check_memory(pair)?;
    if let Some(range) = range_by_matches(pair, least) {
        return range;
    }
    let cause = of_pixels(pair, None).into_iter().find(Warning::is_beyond_range);
    #[cfg(feature = "cameras")]
    let rectified = || {
        let by = Rectification::of_pair(pair, &rectification::Options::default()).ok()?;
        range_by_matches(&by.apply(pair).ok()?, None)
    };
    #[cfg(feature = "cameras")]
    if matches!(cause, None | Some(Warning::NotRectified { .. })) && matches!(rectified(), Some(Ok(_))) {
        return Err(RangeError::NotRectified.into());
    }
    Err(RangeError::NotFound { cause: cause.map(|cause| cause.to_string()) }.into())
}

/// The range of the matches of `pair`, from `least` on; `None` if there are too few.
fn range_by_matches(pair: &Pair, least: Option<f64>) -> Option<Result<DisparityRange>> {
    let mut found = matches::find(pair, None, None);
    let in_front = |m: &SparseMatch, least: f64| f64::from(m.disparity) >= least * f64::from(FRACTION);
    let least = least.filter(|least| 2 * found.iter().filter(|m| in_front(m, *least)).count() > found.len());
    if let Some(least) = least {
        found.retain(|m| in_front(m, least));
    }
    if found.len() < MIN_MATCHES {
        return None;
    }
    let (width, height) = pair.size();
    let mut bare = [true; PARTS * PARTS];
    for m in &found {
        bare[m.y * PARTS / height * PARTS + m.x * PARTS / width] = false;
    }
    let bare = bare.into_iter().filter(|bare| *bare).count();
    let disparities = without_outliers(&found, pair.size());
    let strays = disparities.len() / STRAYS + 1;
    let (far, near) = (disparities[strays], disparities[disparities.len() - 1 - strays]);
    let span = near - far;
    let (min, max) = (far - FRACTION - span / 24, near + 3 * FRACTION + span / 4);
    let min = if 4 * bare > PARTS * PARTS { min.min(0) } else { min };
    let below = disparities.partition_point(|d| *d < -FRACTION);
    let min = if 100 * below > BELOW_PERCENT * disparities.len() { min } else { min.max(0) };
    let (min, max) = (min.div_euclid(FRACTION), -(-max).div_euclid(FRACTION));
    // The conversion saturates.
    let least = least.map_or(min, |least| least.floor() as i32);
    Some(DisparityRange::new(min.max(least), max))
}

/// The sorted disparities of `found` without outliers, in an image of this size.
fn without_outliers(found: &[SparseMatch], size: (usize, usize)) -> Vec<i32> {
    let sorted = |found: &mut dyn Iterator<Item = &SparseMatch>| {
        let mut disparities: Vec<i32> = found.map(|m| m.disparity).collect();
        disparities.sort_unstable();
        disparities
    };
    let all = sorted(&mut found.iter());
    let tail = all.len() * TAIL_PERCENT / 100;
    let (low, high) = (all[tail], all[all.len() - 1 - tail]);
    let beyond = (high - low).max(LEAST_BEYOND * FRACTION);
    let usual = low.saturating_sub(beyond)..=high.saturating_add(beyond);
    sorted(&mut found.iter().filter(|m| usual.contains(&m.disparity) || !is_alone(m, found, size)))
}

/// Whether fewer than two other matches nearby have a similar disparity; parts of a surface have several.
fn is_alone(one: &SparseMatch, all: &[SparseMatch], (width, height): (usize, usize)) -> bool {
    let reach = width.max(height) / PARTS;
    let beside = |m: &&SparseMatch| {
        let apart = one.x.abs_diff(m.x).max(one.y.abs_diff(m.y));
        // Steeper surfaces are hardly seen by both cameras.
        let close = 4 * FRACTION + apart as i32 * FRACTION / 4;
        apart <= reach && one.disparity.abs_diff(m.disparity) <= close.unsigned_abs()
    };
    // The match itself counts too.
    all.iter().filter(beside).count() <= 2
}

/// A range to search again if `maps`, over a range from sparse matches, suggest that the nearest surfaces are beyond it: half as many
/// labels more at the upper end. `None` if the range holds the scene. The lower end stays, because distant surfaces have matches.
#[must_use]
pub fn wider(maps: &Maps, range: DisparityRange) -> Option<DisparityRange> {
    let pixels = maps.raw.data().iter().zip(maps.validity.data());
    let (mut all, mut at_end) = (0, 0);
    for (disparity, _) in pixels.filter(|(_, v)| *v & flag::MASKED == 0) {
        all += 1;
        at_end += usize::from(*disparity > range.max * FRACTION - FRACTION / 2);
    }
    beyond(range).filter(|_| 1000 * at_end > ENDING * all)
}

/// Whether the scene goes beyond the upper end of `range`, by `maps` over a wider range: pixels beyond are found in both
/// views at least half as often as all others. (Open. On two pairs whose road was cut off it is .6 to .95 as often, with
/// `default` and `fast`; on four others that were matched again, whose truth ends before, it is at most .4.)
#[must_use]
pub fn goes_beyond(maps: &Maps, range: DisparityRange) -> bool {
    let (mut all, mut found) = ([0_u64; 2], [0_u64; 2]);
    for (disparity, validity) in maps.raw.data().iter().zip(maps.validity.data()) {
        let beyond = usize::from(*disparity > range.max * FRACTION);
        all[beyond] += u64::from(validity & flag::MASKED == 0);
        found[beyond] += u64::from(validity & flag::INVALID == 0);
    }
    found[1] > 0 && 2 * found[1] * all[0] >= found[0] * all[1]
}

/// `range` with half as many labels more at its upper end; `None` if that is no valid range or `range` consists of ends only.
#[must_use]
pub fn beyond(range: DisparityRange) -> Option<DisparityRange> {
    let max = range.max.checked_add(i32::try_from(range.labels() / 2).ok()?)?;
    DisparityRange::new(range.min, max).ok().filter(|_| range.labels() >= MIN_LABELS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outliers_do_not_count() {
        let at = |x: usize, d: i32| SparseMatch { x, y: 50, disparity: d * FRACTION, dy: 0, score: 1.0 };
        // A surface at 10 to 49, and an object in front of it whose matches support each other.
        let mut found: Vec<_> = (0..400).map(|x| at(x, 10 + x as i32 / 10)).collect();
        found.extend([at(200, 120), at(205, 121), at(212, 122)]);
        let expected: Vec<_> = found.iter().map(|m| m.disparity).collect();
        found.extend([at(30, -634), at(350, 285), at(90, 120)]);
        assert_eq!(without_outliers(&found, (400, 100)), expected);
        // A lone match that is close to the others stays.
        found.truncate(403);
        found.push(at(30, 70));
        assert_eq!(without_outliers(&found, (400, 100)).len(), 404);
    }
}
