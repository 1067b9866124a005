//! Compares the labels of the two views, since pixels seen by only one have no match, and sets the
//! [`Validity`](crate::backend::Map::Validity) of each pixel.
//!
//! For pixel (x, y) with label L and disparity d = low + L (low is the smallest disparity), it is the first
//! that applies:
//!
//! ```text
//! MASKED      the pixel is masked in the left image
//! OUTSIDE     L is NO_LABEL, which occurs in swapped views
//! 0           the check is off
//! OUTSIDE     its match x - d is outside the right image
//! OCCLUDED    |RightLabel(x - d, y) - L| > 1
//! 0           otherwise
//! ```
//!
//! The names are in [`flag`](crate::maps::flag);
//! [`left_right_check`](crate::options::RefinementOptions::left_right_check) turns the check on or off. A
//! right pixel without a label differs from all labels.

use super::{Data, Descriptor, Map, maps};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| [maps(&[Map::Label, Map::RightLabel]), vec![Data::LEFT]].concat(),
    writes: |_| maps(&[Map::Validity]),
    pixel: 1.0,
    ..Descriptor::NONE
};
