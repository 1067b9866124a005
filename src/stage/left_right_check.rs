//! Compares the labels of the two views, since what only one of them sees has no match: the
//! [`Validity`](crate::backend::Map::Validity) of each pixel.
//!
//! For pixel (x, y) with label L, of disparity d = low + L (low is the smallest disparity), it is
//! the first that applies:
//!
//! ```text
//! MASKED      the pixel is masked in the left image
//! OUTSIDE     L is NO_LABEL: it has none, as in a swapped view
//! 0           the check is off
//! OUTSIDE     its match, x - d, is outside the right image
//! OCCLUDED    |RightLabel(x - d, y) - L| > 1
//! 0           otherwise
//! ```
//!
//! The names are those of [`flag`](crate::maps::flag);
//! [`left_right_check`](crate::options::RefinementOptions::left_right_check) says whether the check
//! is off. A right pixel without a label differs from all.

use super::{Data, Descriptor, Map, maps};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| [maps(&[Map::Label, Map::RightLabel]), vec![Data::LEFT]].concat(),
    writes: |_| maps(&[Map::Validity]),
    pixel: 5.0,
    ..Descriptor::NONE
};
