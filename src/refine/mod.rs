//! What follows the estimate, a stage a file: visibility, region filter, fill, weighted median,
//! confidence. All in integers, disparities in 1/256 px.

mod confidence;
mod fill;
mod median;
mod region;
mod visibility;

pub use confidence::confidence;
pub use fill::fill;
pub use median::{MedianWeights, weighted_median};
pub use region::region_filter;
pub use visibility::visibility;

/// Fixed-point units of disparity in one pixel.
pub const FRACTION: i32 = 256;

/// Why a pixel is what it is: bits of the validity map. A pixel of 0 is measured and trusted.
pub mod flag {
    /// The match is outside the right image.
    pub const OUTSIDE: u8 = 1;
    /// The right view disagrees: occluded, or mistaken.
    pub const OCCLUDED: u8 = 2;
    /// The pixel is in a region too small to be trusted.
    pub const SMALL_REGION: u8 = 4;
    /// The confidence is below the floor; the disparity stays.
    pub const LOW_CONFIDENCE: u8 = 8;
    /// The disparity is filled in from other pixels.
    pub const FILLED: u8 = 16;
    /// The pixel is masked in the input, and has no disparity.
    pub const MASKED: u8 = 32;
    /// Any of the reasons for which a disparity is given up before the fill.
    pub const INVALID: u8 = OUTSIDE | OCCLUDED | SMALL_REGION | MASKED;
}
