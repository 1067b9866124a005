//! [`Median`](super::median) by planes: each changed pixel takes the value of a plane fitted to the
//! disparities around it, which preserves slanted surfaces.
//!
//! It uses the places (x, y) of the median, relative to the pixel, with x + y / 2 even: a checkerboard. They
//! have the weight w and, before the stage, the disparity D. `>>` rounds down, / rounds towards 0, and \[f\]
//! is the sum of f over the places.
//!
//! The plane is fitted in two rounds of weighted least squares, starting from the weighted median M over the
//! same places, in steps of 1/8 px ([`PLANE_START_BITS`](crate::plan::planes::PLANE_START_BITS)):
//!
//! ```text
//! M = 32 median((D + 16) >> 5)
//! ```
//!
//! The value of the plane at (x, y) is M + c + a x + b y, in 1/256 px; a, b and c start at 0.
//!
//! For k = 2 and then k = 0 ([`PLANE_BITS`](crate::plan::planes::PLANE_BITS)):
//!
//! 1. The error e at each place, its weight m, which falls to 0 at an error of 256, and the product g:
//!
//!    ```text
//!    e = (D - (M + c + a x + b y)) >> k
//!    m = (w max(256 - |e|, 0)) >> 8
//!    g = (m e) >> 3
//!    ```
//!
//! 2. The weighted centre (u, v) of the places, and the mean error t:
//!
//!    ```text
//!    s = max([m], 1)
//!    u = 16 [m x] / s        v = 16 [m y] / s        t = 32 [g] / s
//!    ```
//!
//! 3. The moments about the centre:
//!
//!    ```text
//!    xx = 16 ([m x x] - ([m x] u >> 4)) / s + 16         xe = (8 [g x] - ([m x] t >> 2)) / s
//!    yy = 16 ([m y y] - ([m y] v >> 4)) / s + 16         ye = (8 [g y] - ([m y] t >> 2)) / s
//!    xy = 16 ([m x y] - ([m x] v >> 4)) / s
//!    ```
//!
//! 4. The new plane, where da and db are the changes of a and b after clamping:
//!
//!    ```text
//!    n = max(xx yy - xy xy, 1)
//!    a = clamp(a + (xe yy - ye xy) 2^(k + 4) / n, -PLANE_STEEPEST, PLANE_STEEPEST)
//!    b = clamp(b + (ye xx - xe xy) 2^(k + 4) / n, -PLANE_STEEPEST, PLANE_STEEPEST)
//!    c = clamp(c + ((2^(k + 2) t - da u - db v + 8) >> 4), -PLANE_FARTHEST, PLANE_FARTHEST)
//!    ```
//!
//! The pixel takes M + c, clamped to the disparity range. (A disparity counts up to 4 px and then up to 1 px
//! from the plane. The + 16 stand for 1 px^2 and damp slopes with little support.) The limits are in
//! [`planes`](crate::plan::planes).

use super::{Data, Descriptor, Map, maps};
use crate::options::Median;

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| [maps(&[Map::Disparity, Map::Validity]), vec![Data::LEFT, Data::MedianWeights]].concat(),
    writes: |_| maps(&[Map::Disparity]),
    needs: |_| vec![Data::NextDisparity],
    taken: |plan| plan.method.refinement.median != Median::Off && plan.method.refinement.plane,
    pixel: 220.0,
    ..Descriptor::NONE
};
