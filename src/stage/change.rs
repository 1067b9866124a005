//! The change of the label map of level 0 since the last time, which decides when message passing ends.
//!
//! ```text
//! new(p) = the label of smallest belief (a cost), the lowest on ties
//! change = sum of (new(p) - old(p))^2 over all pixels
//! old    = new, for the next time                    0 everywhere before the first
//! ```
//!
//! The map has settled if this is not the first time and the change is at most
//! [`settled_change`](crate::plan::Plan::settled_change). Without that limit it never settles.

use super::{Data, Descriptor, Volume};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| vec![Data::Volume(Volume::Belief(0)), Data::LabelMap, Data::Convergence],
    writes: |_| vec![Data::LabelMap, Data::Convergence],
    needs: |_| vec![Data::Squares, Data::RowSums, Data::Groups],
    cell: 0.1,
    ..Descriptor::NONE
};
