//! Fills the [`Disparity`](crate::backend::Map::Disparity) of invalid pixels from the farther side, because
//! occluded pixels belong to the farther surface.
//!
//! Pixels without a flag of [`INVALID`](crate::maps::flag::INVALID) are valid. The farther of two disparities
//! D is the smaller one, or the larger one if [`nearer`](crate::options::RefinementOptions::nearer) is
//! [`Smaller`](crate::options::Nearer::Smaller).
//!
//! 1. For each row r with a valid pixel, F(x, r) is the farther of the D of the nearest valid pixels at or
//!    left of x and at or right of x, or the D of the only one.
//! 2. Each invalid pixel (x, y) that is not masked takes D = F(x, r) of the nearest row r with a valid pixel,
//!    the upper one on ties. It gets [`FILLED`](crate::maps::flag::FILLED) and keeps its other flags.
//!
//! If no pixel is valid, nothing is filled.

use super::{Data, Descriptor, Map, maps};
use crate::options::Fill;

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| maps(&[Map::Disparity, Map::Validity]),
    writes: |_| maps(&[Map::Disparity, Map::Validity]),
    needs: |_| vec![Data::KnownRows, Data::SourceRows, Data::NextDisparity, Data::NextFlags],
    taken: |plan| plan.method.refinement.fill != Fill::None,
    pixel: 1.0,
    ..Descriptor::NONE
};
