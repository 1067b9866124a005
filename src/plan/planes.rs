//! Planes through disparities: the constants of [`Stage::Plane`](crate::backend::Stage::Plane).

/// Disparities count up to 256 times 2 to so many 1/256 px from the plane, by round of least squares.
pub const PLANE_BITS: [u32; 2] = [2, 0];
/// The median that planes start from is found in steps of 2 to so many 1/256 px.
pub const PLANE_START_BITS: u32 = 5;
/// The steepest slope of a plane, in 1/256 px a pixel.
pub const PLANE_STEEPEST: i32 = 256;
/// How far a plane may pass from the median, in 1/256 px: as far as disparities count in the first round.
pub const PLANE_FARTHEST: i32 = 256 << PLANE_BITS[0];
