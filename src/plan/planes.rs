//! Constants of the planes of [`Stage::Plane`](crate::backend::Stage::Plane).

/// By round of least squares: disparities count up to 2^(8 + this) / 256 px from the plane.
pub(crate) const PLANE_BITS: [u32; 2] = [2, 0];
/// The initial median is found in steps of 2^this / 256 px.
pub(crate) const PLANE_START_BITS: u32 = 5;
/// Largest slope of a plane, in 1/256 px per pixel.
pub(crate) const PLANE_STEEPEST: i32 = 256;
/// Limit of the plane's distance from the median, in 1/256 px: the reach of disparities in the first round.
pub(crate) const PLANE_FARTHEST: i32 = 256 << PLANE_BITS[0];
