//! Constants of [`Stage::Support`](crate::backend::Stage::Support).

/// Places along a row and along a column.
pub(crate) const SUPPORT_PLACES: usize = 5;
/// Distance between neighbouring places, in pixels.
pub(crate) const SUPPORT_STEP: usize = 2;
/// Pixels from the middle to the farthest place.
pub(crate) const SUPPORT_REACH: usize = SUPPORT_STEP * (SUPPORT_PLACES / 2);
/// A place supports disparities that differ from its own by at most this, in 1/256 px: 2 px.
pub(crate) const SUPPORT_NEAR: i32 = 512;
