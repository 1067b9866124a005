//! Fits planes to the surroundings of filled pixels, twice: first far in all directions, then along rows,
//! because disparity is constant along rows of roads and floors.
//!
//! For each of [`FILL_STEP_BITS`](crate::weights::FILL_STEP_BITS), (a, b) = (3, 3) and then (4, 0), on the
//! result of the previous one: [`plane`](super::plane), or [`median`](super::median) if
//! [`plane`](crate::options::RefinementOptions::plane) is off, with these differences:
//!
//! - It changes only the pixels with [`FILLED`](crate::maps::flag::FILLED).
//! - The places are (x + 2^a i, y + 2^b j) with |i| and |j| at most 6 and j even; weights and plane use i and
//!   j, not pixels.
//! - A plane uses all places.
//! - The weights are [`of_filled`](crate::weights::MedianWeights::of_filled).

use super::{Data, Descriptor, Map, maps};
use crate::plan::votes;

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| [maps(&[Map::Disparity, Map::Validity]), vec![Data::LEFT, Data::FillWeights]].concat(),
    writes: |_| maps(&[Map::Disparity]),
    needs: |_| vec![Data::NextDisparity],
    taken: |plan| votes::are_taken(&plan.method),
    pixel: 95.0,
    ..Descriptor::NONE
};
