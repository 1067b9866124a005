//! Limits each pixel of a level to its label range, from texture zones and sparse matches, by setting the
//! cost of all other labels to the maximum.
//!
//! ```text
//! cost(p, k) = COST_MAX at level 0, 256 COST_MAX at coarser levels     for k < first or k > last
//! ```
//!
//! first ..= last is the range of pixel p in [`label_ranges`](crate::front::Prepared::label_ranges);
//! [`COST_MAX`](crate::plan::COST_MAX) is the highest possible cost. All other costs stay.

use super::{Data, Descriptor, Volume, volumes};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |z| vec![Data::Volume(Volume::Cost(z)), Data::LabelRange(z)],
    writes: |z| volumes(&[Volume::Cost(z)]),
    cell: 0.5,
    ..Descriptor::NONE
};
