//! The cost of a level (1 or coarser): the cost of the next finer level, smoothed and subsampled by 2 in
//! pixels and labels, so that coarse pixels cover more of the image with fewer labels.
//!
//! C(x, y, d) is the finer level's cost at disparity d, in 1/256 cost units (256 times the stored value at
//! level 0). Disparities d of the finer level lie in low ..= high.
//!
//! 1. Along x and y, at each fine disparity, with positions clamped to the image:
//!
//!    ```text
//!    m(x, y, d) = (sum of B(i) B(j) C(2 x + i, 2 y + j, d) + 128) >> 8     i, j = -2 ..= 2
//!                                                                          B = 1 4 6 4 1
//!    ```
//!
//! 2. Along the labels, at each coarse disparity z, by the rule [`Pyramid`](crate::options::Pyramid):
//!
//!    ```text
//!    low-pass   cost(x, y, z) = (sum of B(i) m(x, y, clamp(2 z + i, low, high)) + 8) >> 4
//!    minimum    cost(x, y, z) = min of m(x, y, d) over d = 2 z - 1 ..= 2 z + 1 in low ..= high
//!    ```
//!
//! The result is also in 1/256 cost units.

use super::{Descriptor, Volume, volumes};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |z| volumes(&[Volume::Cost(z - 1)]),
    writes: |z| volumes(&[Volume::Cost(z)]),
    cell: 2.5,
    ..Descriptor::NONE
};
