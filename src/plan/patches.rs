//! Constants and shape of the patches of [`Stage::FarPlane`](crate::backend::Stage::FarPlane).

use super::Plan;
use super::votes;
use crate::options::{MatchSize, Method};

/// Side of a patch, in pixels.
pub const PATCH: usize = 4;
/// Rounds of sums and planes. After the first, disparities far from the plane count less.
pub const PATCH_ROUNDS: usize = 2;
/// Disparities at this distance from the plane do not count, as a power of 2 in 1/256 px: 4 px.
pub const PATCH_FAR_BITS: u32 = 10;
/// Right shift of the weight of a patch.
pub const PATCH_WEIGHT_BITS: u32 = 3;
/// Limit of the difference from the first disparity of a patch, in 1/16 px: 32 px.
pub const PATCH_SPREAD: i32 = 511;
/// Difference of the mean disparities of two patches above which there is an edge, in 1/1024 px: 2 px.
pub const PATCH_STEP: i32 = 2048;
/// Right shift from the excess difference to levels of colour: 16 per pixel.
pub const PATCH_STEP_BITS: u32 = 6;
/// Limit of the distance of two places, in 1/1024 px: 512 px.
pub const PATCH_AWAY: i32 = (1 << 19) - 1;
/// Limit of the distance of a place from its patch, in 1/1024 px: 4096 px.
pub const PATCH_REACH: i32 = (1 << 22) - 1;
/// Limit of the difference of two mean disparities, in 1/1024 px: 128 px.
pub const PATCH_APART: i32 = (1 << 17) - 1;
/// The largest moment.
pub const PATCH_MOMENT: i32 = (1 << 20) - 1;
/// Ridge that damps slopes with little support: 20 px^2, in quarters.
pub const PATCH_RIDGE: i32 = 80;
/// Largest slope of a plane, in 1/8192: two px per pixel.
pub const PATCH_STEEPEST: i32 = 1 << 14;
/// Words per patch on a device: its moments and its colour, and two sets of accumulated moments.
pub const PATCH_WORDS: usize = 31;
/// Smallest weight of a plane.
pub const PATCH_LEAST: u32 = 240;
/// A plane is trusted if its mean square residual is below this, in 1/256 px^2: half a px^2.
pub const PATCH_RESIDUAL: i32 = 128;
/// Or if it is below the variance of the disparities, shifted by this: an eighth of it.
pub const PATCH_SHARE_BITS: u32 = 3;
/// Trusted planes may outvote measured pixels with less confidence than this, in eighths of a nat.
pub const PATCH_DOUBT: u32 = 24;
/// They do if their difference from the disparity is larger than this, in 1/256 px: half a pixel.
pub const PATCH_OUTVOTES: i32 = 128;

/// Whether `method` uses far planes. At half size, patches would be too coarse.
#[must_use]
pub fn are_taken(method: &Method) -> bool {
    votes::are_taken(method) && method.refinement.plane && method.schedule.match_size != MatchSize::Half
}

/// (width, height) in patches.
#[must_use]
pub fn patches(plan: &Plan) -> (usize, usize) {
    let (width, height) = plan.size();
    (width.div_ceil(PATCH), height.div_ceil(PATCH))
}
