//! [`Median`](super::median), and then planes: each pixel that it changes takes the value at its
//! place of a plane through the disparities around, which keeps slanted surfaces slanted.
//!
//! Of the median's places (x, y), away from the pixel, it looks at those with x + y / 2 even: a
//! checkerboard. They have the weight w and, before the stage, the disparity D. `>>` rounds down,
//! and / towards 0. \[f\] is the sum of f over the places.
//!
//! The plane is fitted by two rounds of weighted least squares. It starts from M, the weighted
//! median over the same places, in steps of 1/8 px
//! ([`PLANE_START_BITS`](crate::plan::planes::PLANE_START_BITS)):
//!
//! ```text
//! M = 32 median((D + 16) >> 5)
//! ```
//!
//! At (x, y) the plane passes at M + c + a x + b y, in 1/256 px; a, b and c start at 0.
//!
//! For k = 2 and then k = 0 ([`PLANE_BITS`](crate::plan::planes::PLANE_BITS)):
//!
//! 1. At each place, the error e, its weight m, which falls to 0 at 256, and their product g:
//!
//!    ```text
//!    e = (D - (M + c + a x + b y)) >> k
//!    m = (w max(256 - |e|, 0)) >> 8
//!    g = (m e) >> 3
//!    ```
//!
//! 2. The centre of the places is at u and v, with a mean error of t:
//!
//!    ```text
//!    s = max([m], 1)
//!    u = 16 [m x] / s        v = 16 [m y] / s        t = 32 [g] / s
//!    ```
//!
//! 3. The moments about it:
//!
//!    ```text
//!    xx = 16 ([m x x] - ([m x] u >> 4)) / s + 16         xe = (8 [g x] - ([m x] t >> 2)) / s
//!    yy = 16 ([m y y] - ([m y] v >> 4)) / s + 16         ye = (8 [g y] - ([m y] t >> 2)) / s
//!    xy = 16 ([m x y] - ([m x] v >> 4)) / s
//!    ```
//!
//! 4. The new plane, where da and db are by how much a and b have grown, after their clamps:
//!
//!    ```text
//!    n = max(xx yy - xy xy, 1)
//!    a = clamp(a + (xe yy - ye xy) 2^(k + 4) / n, -PLANE_STEEPEST, PLANE_STEEPEST)
//!    b = clamp(b + (ye xx - xe xy) 2^(k + 4) / n, -PLANE_STEEPEST, PLANE_STEEPEST)
//!    c = clamp(c + ((2^(k + 2) t - da u - db v + 8) >> 4), -PLANE_FARTHEST, PLANE_FARTHEST)
//!    ```
//!
//! The pixel takes M + c, clamped to the range of the disparities. (A disparity counts up to 4 px
//! and then up to 1 px from the plane. The + 16 stand for 1 px^2, which holds slopes that little
//! supports.) The limits are in [`planes`](crate::plan::planes).

use super::{Data, Descriptor, Map, maps};
use crate::options::Median;

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| [maps(&[Map::Disparity, Map::Validity]), vec![Data::LEFT, Data::MedianWeights]].concat(),
    writes: |_| maps(&[Map::Disparity]),
    needs: |_| vec![Data::NextDisparity],
    taken: |method| method.refinement.median != Median::Off && method.refinement.plane,
    pixel: 90.0,
    ..Descriptor::NONE
};
