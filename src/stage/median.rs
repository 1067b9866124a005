//! Weighted median of [`Disparity`](crate::backend::Map::Disparity): removes outliers, and keeps edges that
//! the left image shows too.
//!
//! 1. It changes the pixels selected by [`median`](crate::options::RefinementOptions::median): none, the
//!    filled ones, or all that [have a disparity](crate::maps::has_disparity).
//! 2. The places of pixel (x, y) are the pixels (x + i, y + j) that are inside and have a disparity, with j
//!    even and |i| and |j| at most floor([`median_window`](crate::options::RefinementOptions::median_window)
//!    / 2): every second row, including the row of the centre.
//! 3. With D the disparities before the stage and w the [`MedianWeights`](crate::weights::MedianWeights) of
//!    the places, by their distance in space and in the colour of the left image:
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
    taken: |plan| plan.method.refinement.median != Median::Off && !plan.method.refinement.plane,
    pixel: 110.0,
    ..Descriptor::NONE
};
