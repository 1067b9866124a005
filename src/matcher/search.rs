//! Which disparities a match searches: a range, or the one that sparse matches find.

use crate::error::Result;
use crate::front::check;
use crate::image::Pair;
use crate::options::DisparityRange;
use std::ops::{RangeFull, RangeInclusive};

/// The disparities to search: `0..=47`, or `..` for the range that sparse matches find in the pair.
pub trait Search: Send {
    /// Whether the range is that of sparse matches. Near surfaces may lack these: where a match shows that the scene probably goes
    /// beyond it, the pair is matched once more, over [half as many labels more](crate::check::wider). What this gives is taken where
    /// it [finds](crate::check::goes_beyond) surfaces there.
    const FOUND: bool = false;

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

/// A range that sparse matches have found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Found(pub DisparityRange);

impl Search for Found {
    const FOUND: bool = true;

    fn range(self, _: &Pair) -> Result<DisparityRange> {
        Ok(self.0)
    }
}

impl Search for RangeFull {
    const FOUND: bool = true;

    fn range(self, pair: &Pair) -> Result<DisparityRange> {
        check::range(pair)
    }
}
