//! The disparities to search.

use std::ops::RangeInclusive;

use serde::Serialize;

use crate::error::{Error, RangeError, Result};

/// Most labels of a range, limited by 16-bit label indices and by devices.
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
    /// [`Error::Range`] when it is empty, or beyond [`MAX_LABELS`] or [`MAX_DISPARITY`].
    pub fn new(min: i32, max: i32) -> Result<Self> {
        if min > max {
            return Err(RangeError::Empty { min, max }.into());
        }
        if min < -MAX_DISPARITY || max > MAX_DISPARITY {
            let disparity = if max > MAX_DISPARITY { max } else { min };
            return Err(RangeError::TooFar { disparity, limit: MAX_DISPARITY }.into());
        }
        if i64::from(max) - i64::from(min) >= MAX_LABELS as i64 {
            return Err(RangeError::TooManyLabels { min, max, limit: MAX_LABELS }.into());
        }
        Ok(Self { min, max })
    }

    /// Checks that some disparity of the range connects two pixels of images with `width` columns.
    ///
    /// # Errors
    /// [`Error::Range`] when none does.
    pub fn within(self, width: usize) -> Result<Self> {
        let Self { min, max } = self;
        let reach = i32::try_from(width).unwrap_or(i32::MAX);
        if min >= reach || max <= -reach {
            Err(RangeError::OutsideImages { min, max, width }.into())
        } else {
            Ok(self)
        }
    }

    /// The range of the same surfaces in a pair of twice the size.
    ///
    /// # Errors
    /// [`Error::Range`] beyond [`MAX_LABELS`] or [`MAX_DISPARITY`], with the limit before doubling.
    pub fn doubled(self) -> Result<Self> {
        let Self { min, max } = self;
        Self::new(2 * min, 2 * max).map_err(|error| match error {
            Error::Range(RangeError::TooManyLabels { .. }) => {
                RangeError::TooManyLabels { min, max, limit: MAX_LABELS / 2 }.into()
            }
            Error::Range(RangeError::TooFar { disparity, .. }) => {
                RangeError::TooFar { disparity: disparity / 2, limit: MAX_DISPARITY / 2 }.into()
            }
            error => error,
        })
    }

    /// The range of the same surfaces in a pair of half the size.
    #[must_use]
    pub fn halved(self) -> Self {
        Self { min: self.min.div_euclid(2), max: -((-self.max).div_euclid(2)) }
    }

    /// Number of labels.
    #[must_use]
    pub fn labels(self) -> usize {
        (self.max - self.min + 1) as usize
    }
}

impl TryFrom<RangeInclusive<i32>> for DisparityRange {
    type Error = Error;

    /// Like [`DisparityRange::new`].
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
    fn invalid_ranges_are_refused() {
        assert_eq!(DisparityRange::new(-3, -3).unwrap().labels(), 1);
        for (min, max, words) in [
            (5, 4, ["4 is", "below the minimum disparity 5"]),
            (0, 2_000_000, ["2000000", "too far from 0"]),
            (-2_000_000, 0, ["-2000000", "too far from 0"]),
            (i32::MIN, i32::MAX, ["disparity", "too far from 0"]),
            (0, 16_384, ["16385 disparities", "at most 16384 can be searched"]),
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
