//! The cost of a level (1 or coarser) from that of the next finer one, smoothed and taken at every
//! second pixel and label, so that coarse pixels see more of the image in fewer labels.
//!
//! C(x, y, d) is the finer level's cost at disparity d, in 1/256 cost units (256 times what is
//! stored at level 0). Disparities d of the finer level lie in low ..= high.
//!
//! 1. Along x and y, at each fine disparity, with the places clamped to the image:
//!
//!    ```text
//!    m(x, y, d) = (sum of B(i) B(j) C(2 x + i, 2 y + j, d) + 128) >> 8     i, j = -2 ..= 2
//!                                                                          B = 1 4 6 4 1
//!    ```
//!
//! 2. Along the labels, at each coarse disparity z, as [`Pyramid`](crate::options::Pyramid) says:
//!
//!    ```text
//!    low-pass   cost(x, y, z) = (sum of B(i) m(x, y, clamp(2 z + i, low, high)) + 8) >> 4
//!    minimum    cost(x, y, z) = min of m(x, y, d) over d = 2 z - 1 ..= 2 z + 1 in low ..= high
//!    ```
//!
//! The result is in 1/256 cost units, too.

use super::{Descriptor, Volume, volumes};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |z| volumes(&[Volume::Cost(z - 1)]),
    writes: |z| volumes(&[Volume::Cost(z)]),
    cell: 4.9,
    ..Descriptor::NONE
};
