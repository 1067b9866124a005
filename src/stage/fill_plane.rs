//! Lays planes through what surrounds filled pixels, twice: once far in all directions, then along
//! rows, since there roads and floors stay at one disparity.
//!
//! For each of [`FILL_STEP_BITS`](crate::weights::FILL_STEP_BITS), (a, b) = (3, 3) and then (4, 0),
//! from what the last has left: [`plane`](super::plane), or [`median`](super::median) where
//! [`plane`](crate::options::RefinementOptions::plane) is off, with these differences:
//!
//! - It changes the pixels with [`FILLED`](crate::maps::flag::FILLED), and no others.
//! - Its places are (x + 2^a i, y + 2^b j) with |i| and |j| at most 6 and j even; the weights and
//!   the plane count i and j, not pixels.
//! - A plane looks at all of them.
//! - The weights are those [`of_filled`](crate::weights::MedianWeights::of_filled) pixels.

use super::{Data, Descriptor, Map, maps};
use crate::plan::votes;

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| [maps(&[Map::Disparity, Map::Validity]), vec![Data::LEFT, Data::FillWeights]].concat(),
    writes: |_| maps(&[Map::Disparity]),
    needs: |_| vec![Data::NextDisparity],
    taken: votes::are_taken,
    pixel: 48.0,
    ..Descriptor::NONE
};
