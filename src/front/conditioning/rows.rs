//! Rows that do not line up: an aged calibration, or a rig that was bumped.

use crate::front::matches::{self, SparseMatch, median};
use crate::image::Pair;
use crate::options::DisparityRange;

/// Approximate number of corners to match.
const SAMPLE: usize = 600;
/// Fewer matches than this are not reliable.
pub(super) const MIN_MATCHES: usize = 30;
/// Rows above and below its own on which a corner is searched, at half the size.
const ROWS: usize = 2;
/// Smallest offset that is corrected, in 1/256 px (open): resampling costs a little sharpness.
const MIN_OFFSET: i32 = 16;

/// Sparse matches of a pair at half its size, where noise and blur matter less; `range` is at full size.
pub(super) fn matches(halves: &Pair, range: DisparityRange) -> Vec<SparseMatch> {
    let (width, height) = halves.size();
    let range = DisparityRange { min: range.min.div_euclid(2), max: range.max.div_euclid(2) + 1 };
    matches::search(halves, None, Some(range), width * height / SAMPLE, ROWS)
}

/// The row offset of a pair from matches at half its size, in 1/256 px; 0 if it is too small or not
/// significant (three standard errors of the median).
pub(super) fn offset(matches: &[SparseMatch]) -> i32 {
    let offset = median_offset(matches);
    let deviation = i64::from(median(matches.iter().map(|m| (2 * m.dy - offset).abs())));
    let count = matches.len() as i64;
    let sure = count * i64::from(offset).pow(2) >= 31 * deviation.pow(2);
    if sure && offset.abs() >= MIN_OFFSET { offset } else { 0 }
}

/// The row offset without these limits. As a median, it ignores moving objects and false matches; rotations remain.
pub(super) fn median_offset(matches: &[SparseMatch]) -> i32 {
    if matches.len() < MIN_MATCHES { 0 } else { median(matches.iter().map(|m| 2 * m.dy)) }
}
