//! The maps at full size of a pair that is matched at half of it: colours say on which side of an edge a pixel is.
//!
//! A pixel p = (X, Y) of the full size is in the block of the pixel q0 = (floor(X / 2), floor(Y / 2)) of half the size. With low and
//! high the range of the pair, in 1/256 px of the full size:
//!
//! ```text
//! d(q) = clamp(2 Disparity(q), low, high)
//! N    = those q of the 3 x 3 around q0 that are inside and have a disparity
//! ```
//!
//! 1. Where q0 has no disparity, and where p is masked: the disparity is d(q0), and q* = q0.
//! 2. Where the disparities d of N span at most 256, there is no edge, and q* = q0. With qx and qy the neighbours of q0 on
//!    the side of p, to the left or right and above or below, and qxy the one beside both, clamped to the image and q0 where they have
//!    no disparity:
//!
//!    ```text
//!    floor((9 d(q0) + 3 d(qx) + 3 d(qy) + d(qxy) + 8) / 16)
//!    ```
//!
//! 3. Elsewhere, with u(q) how unlike q is:
//!
//!    ```text
//!    u(q) = sum over red, green, blue of |colour of q at half the size - colour of p at full size|, in whole 8-bit levels
//!           + AWAY times their distance along x and y, in pixels of the full size: (|4 x + 1 - 2 X| + |4 y + 1 - 2 Y|) / 2
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

/// What each pixel of the full size that a pixel is away counts as a difference in colour, in 8-bit levels.
pub const AWAY: i32 = 8;
/// How much more unlike than the most similar pixel a pixel may be and still count, in 8-bit levels.
pub const NEAR: i32 = 64;

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| {
        let maps = maps(&[Map::Raw, Map::Disparity, Map::Validity, Map::Confidence]);
        [maps, vec![Data::LEFT, Data::FullLeft]].concat()
    },
    writes: |_| maps(&Map::FULL),
    taken: |method| method.schedule.match_size == MatchSize::Half,
    pixel: 60.0,
    ..Descriptor::NONE
};
