//! The disparities that a match searches: a given range, or one from sparse matches.

use crate::error::Result;
use crate::front::check;
use crate::image::Pair;
use crate::options::DisparityRange;
use std::ops::{RangeFull, RangeInclusive};

/// The disparities to search: `0..=47`, or `..` for the range of the sparse matches of the pair.
pub trait Search: Send {
    /// Whether the range comes from sparse matches, which near surfaces may lack. If the maps suggest that the
    /// scene goes beyond the range, the pair is matched again with [half as many labels
    /// more](crate::check::wider). That result counts if it [finds](crate::check::goes_beyond) surfaces there.
    const AUTOMATIC: bool = false;

    /// The range for `pair`.
    ///
    /// # Errors
    /// [`Error::Range`](crate::Error::Range) for an invalid range, and when none is found;
    /// [`Error::Memory`](crate::Error::Memory) when the machine has too little memory to find one.
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

/// A range that was found from sparse matches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AutoRange(pub DisparityRange);

impl Search for AutoRange {
    const AUTOMATIC: bool = true;

    fn range(self, _: &Pair) -> Result<DisparityRange> {
        Ok(self.0)
    }
}

impl Search for RangeFull {
    const AUTOMATIC: bool = true;

    fn range(self, pair: &Pair) -> Result<DisparityRange> {
        check::range(pair)
    }
}
