//! Weighted median of [`Disparity`](crate::backend::Map::Disparity), which removes outliers and
//! keeps edges, where the left image has them too.
//!
//! 1. It changes the pixels that [`median`](crate::options::RefinementOptions::median) names: none,
//!    the filled ones, or all that [have a disparity](crate::maps::has_disparity).
//! 2. The places of pixel (x, y) are the pixels (x + i, y + j) that are inside and have a
//!    disparity, with |i| and
//!    |j| at most floor([`median_window`](crate::options::RefinementOptions::median_window) / 2),
//!    and j even: every second row, the centre's among them.
//! 3. With D the disparities before the stage and w the
//!    [`MedianWeights`](crate::weights::MedianWeights) of the places, by what they are away in
//!    space and in the colour of the left image:
//!
//!    ```text
//!    w(i, j) = max(127 - space(i, j) - colour(i, j), 0)
//!    median  = the smallest D of a place such that  2 (sum of w over places with D <= median)
//!                                                      >= sum of w over all places
//!    ```

use super::{Data, Descriptor, Map, maps};
use crate::options::Median;

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| [maps(&[Map::Disparity, Map::Validity]), vec![Data::LEFT, Data::MedianWeights]].concat(),
    writes: |_| maps(&[Map::Disparity]),
    needs: |_| vec![Data::NextDisparity],
    taken: |method| method.refinement.median != Median::Off && !method.refinement.plane,
    pixel: 60.0,
    ..Descriptor::NONE
};
