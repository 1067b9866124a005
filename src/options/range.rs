//! The disparities to search.

use std::ops::RangeInclusive;

use serde::Serialize;

use crate::error::{Error, Result};

/// Most labels of a range: what 16-bit label indices and every device's limits allow.
pub const MAX_LABELS: usize = 16_384;
/// Largest absolute disparity: the fixed-point maps hold 1/256 px in 32 bits with room for differences.
pub const MAX_DISPARITY: i32 = 1 << 20;

/// The disparities to search, in pixels, both ends included. `(0..=47).try_into()` makes one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct DisparityRange {
    /// Smallest disparity; may be negative.
    pub min: i32,
    /// Largest disparity, at least `min`.
    pub max: i32,
}

impl DisparityRange {
    /// The range `min ..= max`.
    ///
    /// # Errors
    /// [`Error::Option`] when it is empty, or beyond [`MAX_LABELS`] or [`MAX_DISPARITY`].
    pub fn new(min: i32, max: i32) -> Result<Self> {
        if min > max {
            return Err(Error::option(
                "--max-disparity",
                format!("{max} is below the minimum disparity {min}: raise it or lower --min-disparity"),
            ));
        }
        if min < -MAX_DISPARITY || max > MAX_DISPARITY {
            let (name, value) =
                if max > MAX_DISPARITY { ("--max-disparity", max) } else { ("--min-disparity", min) };
            return Err(Error::option(
                name,
                format!("{value} is out of reach: disparities are within {MAX_DISPARITY} px of 0"),
            ));
        }
        let labels = i64::from(max) - i64::from(min) + 1;
        if labels > MAX_LABELS as i64 {
            return Err(Error::option(
                "--max-disparity",
                format!("{min} to {max} are {labels} labels and at most {MAX_LABELS} fit: narrow the range"),
            ));
        }
        Ok(Self { min, max })
    }

    /// Number of labels.
    #[must_use]
    pub fn labels(self) -> usize {
        (self.max - self.min + 1) as usize
    }
}

impl TryFrom<RangeInclusive<i32>> for DisparityRange {
    type Error = Error;

    /// As [`DisparityRange::new`].
    fn try_from(range: RangeInclusive<i32>) -> Result<Self> {
        Self::new(*range.start(), *range.end())
    }
}

impl From<DisparityRange> for RangeInclusive<i32> {
    fn from(range: DisparityRange) -> Self {
        range.min..=range.max
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_name_the_flag_to_change() {
        assert_eq!(DisparityRange::new(-3, -3).unwrap().labels(), 1);
        for (min, max, words) in [
            (5, 4, ["--max-disparity", "below the minimum"]),
            (0, 2_000_000, ["--max-disparity", "out of reach"]),
            (-2_000_000, 0, ["--min-disparity", "out of reach"]),
            (i32::MIN, i32::MAX, ["disparity", "out of reach"]),
            (0, 16_384, ["--max-disparity", "narrow the range"]),
        ] {
            let error = DisparityRange::new(min, max).unwrap_err().to_string();
            assert!(words.iter().all(|w| error.contains(w)), "{error}");
        }
    }

    #[test]
    fn rust_ranges_convert() {
        let range = DisparityRange::try_from(-3..=47).unwrap();
        assert_eq!((range.min, range.max), (-3, 47));
        assert_eq!(RangeInclusive::from(range), -3..=47);
        #[allow(clippy::reversed_empty_ranges, reason = "that is the case")]
        let empty = DisparityRange::try_from(5..=4);
        assert!(empty.unwrap_err().to_string().contains("below the minimum"));
    }
}
