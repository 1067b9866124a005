//! Which disparities a match searches: a range, or the one that sparse matches find.

use crate::error::{RangeError, Result};
use crate::front::check;
use crate::image::Pair;
use crate::options::DisparityRange;
use std::ops::{RangeFull, RangeInclusive};

/// The disparities to search: `0..=47`, or `..` for the range that sparse matches find in the pair.
pub trait Search: Send {
    /// The range for `pair`.
    ///
    /// # Errors
    /// [`Error::Range`](crate::Error::Range) for a range that makes no sense, and where none is found;
    /// [`Error::Memory`](crate::Error::Memory) when the machine has not enough to look for one.
    fn range(self, pair: &Pair) -> Result<DisparityRange>;
}

impl Search for DisparityRange {
    fn range(self, _: &Pair) -> Result<DisparityRange> {
        Ok(self)
    }
}

impl Search for RangeInclusive<i32> {
    fn range(self, _: &Pair) -> Result<DisparityRange> {
        self.try_into()
    }
}

impl Search for RangeFull {
    fn range(self, pair: &Pair) -> Result<DisparityRange> {
        check::range(pair)?.ok_or_else(|| RangeError::NotFound.into())
    }
}
