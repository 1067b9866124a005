//! Range and warnings of a pair that is larger than memory, from the pair at a fraction of its size.

use super::range::{range, range_of_cameras};
use super::warnings::{Warning, warnings};
use crate::error::Result;
use crate::image::windows::{Overview, PairWindows};
use crate::options::{DisparityRange, Method};

/// Bytes that sparse matches and warnings take for each pixel.
const BYTES: u64 = 128;

/// The pair in `windows` at the largest fraction of its size whose sparse matches fit in the memory of `method`.
///
/// # Errors
/// The errors of [`PairWindows::window`].
pub fn overview(windows: &PairWindows, method: &Method) -> Result<Overview> {
    let most = (u64::from(method.tiles.memory) << 20) / BYTES;
    windows.overview(usize::try_from(most).unwrap_or(usize::MAX))
}

/// The range of disparities in the whole pair, as [`range`] finds it in `overview`, or as [`range_of_cameras`] does with the offset `doffs` of
/// the principal points, in pixels of the whole pair.
///
/// # Errors
/// The errors of [`range`].
pub fn range_of_overview(overview: &Overview, doffs: Option<f64>) -> Result<DisparityRange> {
    let Overview { pair, factor } = overview;
    let found = match doffs {
        Some(doffs) => range_of_cameras(pair, doffs / *factor as f64)?,
        None => range(pair)?,
    };
    let scaled = |end: i32| i32::try_from(*factor).unwrap_or(i32::MAX).saturating_mul(end);
    DisparityRange::new(scaled(found.min), scaled(found.max))
}

/// The likely faults of the whole pair, as [`warnings`] finds them in `overview`; `range` is that of the user, if there is one.
#[must_use]
pub fn warnings_of_overview(overview: &Overview, range: Option<DisparityRange>) -> Vec<Warning> {
    let factor = i32::try_from(overview.factor).unwrap_or(i32::MAX);
    let range = range.map(|DisparityRange { min, max }| DisparityRange {
        min: min.div_euclid(factor),
        max: -(-max).div_euclid(factor),
    });
    let mut found = warnings(&overview.pair, range);
    for warning in &mut found {
        if let Warning::NotRectified { offset } = warning {
            *offset = offset.saturating_mul(factor.unsigned_abs());
        }
    }
    found
}
