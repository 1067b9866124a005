//! Upsamples the maps of a pair matched at half its size: colour decides on which side of an edge a pixel lies.
//!
//! A full-size pixel p = (X, Y) is in the block of the half-size pixel q0 = (floor(X / 2), floor(Y / 2)).
//! With low and high the range of the pair, in 1/256 px at full size:
//!
//! ```text
//! d(q) = clamp(2 Disparity(q), low, high)
//! N    = the q of the 3 x 3 around q0 that are inside and have a disparity
//! ```
//!
//! 1. If q0 has no disparity or p is masked: the disparity is d(q0), and q* = q0.
//! 2. If the disparities d of N span at most 256, there is no edge, and q* = q0. qx and qy are the neighbours
//!    of q0 on the side of p, horizontally and vertically, and qxy is the diagonal one, all clamped to the
//!    image, and replaced by q0 if they have no disparity. The disparity is
//!
//!    ```text
//!    floor((9 d(q0) + 3 d(qx) + 3 d(qy) + d(qxy) + 8) / 16)
//!    ```
//!
//! 3. Otherwise, with the dissimilarity u(q):
//!
//!    ```text
//!    u(q) = sum over red, green, blue of |half-size colour of q - full-size colour of p|, in whole 8-bit levels
//!           + AWAY times their city block distance, in full-size pixels: (|4 x + 1 - 2 X| + |4 y + 1 - 2 Y|) / 2
//!    q*   = the q of N of smallest u, the first in raster order on ties
//!    w(q) = max(0, NEAR + u(q*) - u(q)) for the q of N with |d(q) - d(q*)| <= 256
//!    ```
//!
//!    and the disparity is d(q*) + (sum of w(q) (d(q) - d(q*))) / (sum of w(q)), rounded towards 0.
//!
//! [`FullDisparity`](crate::backend::Map::FullDisparity) is the disparity, [`FullRaw`](crate::backend::Map::FullRaw) is
//! clamp(2 Raw(q0), low, high), and [`FullValidity`](crate::backend::Map::FullValidity) and
//! [`FullConfidence`](crate::backend::Map::FullConfidence) are those of q*. Where p is masked, they are
//! [`MASKED`](crate::maps::flag::MASKED) and 0.

use super::{Data, Descriptor, Map, maps};
use crate::options::MatchSize;

/// Weight of a distance of one full-size pixel, as a difference in colour in 8-bit levels.
pub(crate) const AWAY: i32 = 8;
/// Pixels count if their dissimilarity exceeds the smallest one by less than this, in 8-bit levels.
pub(crate) const NEAR: i32 = 64;

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| {
        let maps = maps(&[Map::Raw, Map::Disparity, Map::Validity, Map::Confidence]);
        [maps, vec![Data::LEFT, Data::FullLeft]].concat()
    },
    writes: |_| maps(&Map::FULL),
    taken: |plan| plan.method.schedule.match_size == MatchSize::Half,
    pixel: 40.0,
    ..Descriptor::NONE
};
