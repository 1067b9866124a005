//! The two storage widths of messages.

use crate::plan::NARROW_INFINITE;
use std::ops::{Add, Sub};

/// A stored message value.
pub(super) trait Message: Copy + Default + Send + Sync + Into<u32> + Into<u16> {
    /// Holds any sum of a factor's messages; the plan proves that it does.
    type Sum: Copy
        + Default
        + Ord
        + Send
        + Sync
        + From<u16>
        + Into<u32>
        + Add<Output = Self::Sum>
        + Sub<Output = Self::Sum>;

    /// Stands for "agrees with no label" in resolution factors: above every finite sum, and five of them fit a sum.
    const INFINITE: Self::Sum;

    /// A value that is known to fit.
    fn from_sum(sum: Self::Sum) -> Self;

    /// A value that is known to fit.
    fn from_u32(value: u32) -> Self;

    /// A sum that is known to fit.
    fn sum_from_u32(value: u32) -> Self::Sum;
}

impl Message for u8 {
    type Sum = u16;

    const INFINITE: u16 = NARROW_INFINITE as u16;

    fn from_sum(sum: u16) -> Self {
        sum as Self
    }

    fn from_u32(value: u32) -> Self {
        value as Self
    }

    fn sum_from_u32(value: u32) -> u16 {
        value as u16
    }
}

impl Message for u16 {
    type Sum = u32;

    const INFINITE: u32 = 1 << 20;

    fn from_sum(sum: u32) -> Self {
        sum as Self
    }

    fn from_u32(value: u32) -> Self {
        value as Self
    }

    fn sum_from_u32(value: u32) -> u32 {
        value
    }
}
