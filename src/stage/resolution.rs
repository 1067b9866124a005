//! Messages of the resolution factors between a level (1 or coarser) and the next finer one, in both
//! directions: a coarse pixel and its children should be at the same depth.
//!
//! The stage reads beliefs and old messages from before it, and does not change beliefs. Both are costs;
//! infinity is inf = [`VolumeWidth::most`](crate::plan::VolumeWidth::most). Each coarse pixel (x, y) has one
//! factor: it is the parent P of its children (2 x, 2 y) to (2 x + 1, 2 y + 1) inside the image. A disparity
//! d of the finer level and z of the coarser agree, by the rule [`Agreement`](crate::options::Agreement), if
//!
//! ```text
//! interpolating   |d - 2 z| <= 1            an odd d agrees with both of its coarse neighbours
//! strict           d = 2 z                  an odd d agrees with none
//! ```
//!
//! 1. From P and from each child c to the factor, with the belief b and the factor's old message m:
//!
//!    ```text
//!    q(P, z) = b(P, z) - m(P, z),   q(c, d) = b(c, d) - m(c, d)          inf where b is
//!    ```
//!
//!    If the rule is [`Absolute`](crate::plan::TruncationRule::Absolute), the minimum over the pixel's labels
//!    is subtracted from each finite q.
//! 2. The costs U of coarse disparities for each child, and the sums for parent and children:
//!
//!    ```text
//!    U(c, z) = min of q(c, d) over the d that agree with z               inf if none does
//!    S(P, z) = min(sum of U(c, z) over all c, inf)
//!    T(c, z) = min(q(P, z) + sum of U(c', z) over the other children c', inf)
//!    S(c, d) = min of T(c, z) over the z that agree with d               inf if none does
//!    ```
//!
//! 3. The messages at the labels that the pixel has, truncated by
//!    [`Plan::resolution`](crate::plan::Plan::resolution) with the cost of disagreement tau:
//!
//!    ```text
//!    m = min(S, high) - low                 for P (up) and for each child (down)
//!
//!    relative   low = min(least, inf - tau), high = low + tau
//!               with least = the smallest S of the labels that the pixel has
//!    absolute   low = 0, high = tau
//!    ```
//!
//! Messages at labels that the pixel does not have are undefined. Messages that were never sent count as 0.

use super::{Data, Descriptor, Volume, volumes};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |z| {
        let volumes =
            volumes(&[Volume::Belief(z - 1), Volume::Belief(z), Volume::Down(z - 1), Volume::Up(z)]);
        [volumes, vec![Data::Windows(z), Data::Windows(z - 1)]].concat()
    },
    writes: |z| volumes(&[Volume::Down(z - 1), Volume::Up(z)]),
    reach: Some(0),
    joins: true,
    cell: 4.0,
    ..Descriptor::NONE
};
