//! Fills the [`Disparity`](crate::backend::Map::Disparity) of invalid pixels from the farther side:
//! what is occluded belongs to the farther surface.
//!
//! A pixel is valid without a flag of [`INVALID`](crate::maps::flag::INVALID). Farther is the
//! smaller of two disparities D, or the larger where
//! [`nearer`](crate::options::RefinementOptions::nearer) is
//! [`Smaller`](crate::options::Nearer::Smaller).
//!
//! 1. For each row r with a valid pixel, F(x, r) is the farther of the D of the nearest valid
//!    pixels at or left of x and at or right of x, or that of the one there is.
//! 2. Each pixel (x, y) that is invalid and not masked takes D = F(x, r), with r the nearest row
//!    that has a valid pixel: y itself, if it does; the upper one on ties. It gets
//!    [`FILLED`](crate::maps::flag::FILLED), and keeps its other flags.
//!
//! Where no pixel at all is valid, nothing is filled.

use super::{Data, Descriptor, Map, maps};
use crate::options::Fill;

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| maps(&[Map::Disparity, Map::Validity]),
    writes: |_| maps(&[Map::Disparity, Map::Validity]),
    needs: |_| vec![Data::KnownRows, Data::SourceRows, Data::NextDisparity, Data::NextFlags],
    taken: |method| method.refinement.fill != Fill::None,
    pixel: 4.0,
    ..Descriptor::NONE
};
