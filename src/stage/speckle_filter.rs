//! Flags pixels whose label has no support: ties, and regions that are too small.
//!
//! 1. Unflagged pixels whose runner-up has the belief of the best label,
//!    [`RunnerUp`](crate::backend::Map::RunnerUp) = [`Best`](crate::backend::Map::Best), get
//!    [`TIE`](crate::maps::flag::TIE).
//! 2. The remaining unflagged pixels form regions: two that share a side are connected if their labels differ
//!    by at most 1.
//! 3. All pixels of a region of fewer than
//!    [`speckle_size`](crate::options::RefinementOptions::speckle_size) pixels get
//!    [`SPECKLE`](crate::maps::flag::SPECKLE).
//!
//! (In a tie nothing distinguishes the labels, for example where an image is overexposed. The best label is
//! then just the lowest one, possibly in large regions.)

use super::{Data, Descriptor, Map, maps};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| maps(&[Map::Label, Map::Best, Map::RunnerUp, Map::Validity]),
    writes: |_| maps(&[Map::Validity]),
    needs: |_| vec![Data::Parents, Data::Sizes],
    taken: |plan| plan.method.refinement.speckle_size > 0,
    pixel: 2.0,
    ..Descriptor::NONE
};
