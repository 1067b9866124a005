//! Planes from far away: the constants and the shape of [`Stage::FarPlane`](crate::backend::Stage::FarPlane).

use super::Plan;
use super::votes;
use crate::options::{MatchSize, Method};

/// Side of a patch, in pixels.
pub const PATCH: usize = 4;
/// Rounds of sums and planes. From the second one on, disparities far from the plane count less.
pub const PATCH_ROUNDS: usize = 2;
/// Distance from the plane from which on a disparity no longer counts, in 1/256 px: 2 to so many, 4 px.
pub const PATCH_FAR_BITS: u32 = 10;
/// Bits that the weight of a patch loses.
pub const PATCH_WEIGHT_BITS: u32 = 3;
/// Farthest that a disparity counts from the first one of its patch, in 1/16 px: 32 px.
pub const PATCH_SPREAD: i32 = 511;
/// How far the mean disparities of two patches may be apart without an edge between them, in 1/1024 px: 2 px.
pub const PATCH_STEP: i32 = 2048;
/// Bits that turn what is above that into levels of colour: 16 for each pixel.
pub const PATCH_STEP_BITS: u32 = 6;
/// How far a place is from another at most, in 1/1024 px: 512 px.
pub const PATCH_AWAY: i32 = (1 << 19) - 1;
/// How far a place is from its patch at most, in 1/1024 px: 4096 px.
pub const PATCH_REACH: i32 = (1 << 22) - 1;
/// How far a mean disparity is from another at most, in 1/1024 px: 128 px.
pub const PATCH_APART: i32 = (1 << 17) - 1;
/// The largest moment.
pub const PATCH_MOMENT: i32 = (1 << 20) - 1;
/// What holds slopes that little supports: 20 px^2, in quarters.
pub const PATCH_RIDGE: i32 = 80;
/// The steepest plane, in 1/8192: two pixels a pixel.
pub const PATCH_STEEPEST: i32 = 1 << 14;
/// Numbers that a device keeps of a patch: its own moments and its colour, and twice the moments that reach it.
pub const PATCH_WORDS: usize = 31;
/// The least weight that a plane has.
pub const PATCH_LEAST: u32 = 240;
/// A plane is trusted where the mean square of what it leaves is below this, in 1/256 px^2: half a px^2.
pub const PATCH_RESIDUAL: i32 = 128;
/// Or below the variance of the disparities, shifted by so many bits: an eighth of it.
pub const PATCH_SHARE_BITS: u32 = 3;
/// A measured pixel with less confidence than this, in eighths of a nat, may be outvoted by a trusted plane.
pub const PATCH_DOUBT: u32 = 24;
/// It is outvoted by a plane that is further from its disparity than this, in 1/256 px: half a pixel.
pub const PATCH_OUTVOTES: i32 = 128;

/// Whether `method` carries planes far. At half size a patch would see too much at once.
#[must_use]
pub fn are_taken(method: &Method) -> bool {
    votes::are_taken(method) && method.refinement.plane && method.schedule.match_size != MatchSize::Half
}

/// (width, height) of the patches of a match.
#[must_use]
pub fn patches(plan: &Plan) -> (usize, usize) {
    let (width, height) = plan.size();
    (width.div_ceil(PATCH), height.div_ceil(PATCH))
}
