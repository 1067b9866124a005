//! Flags pixels whose label nothing supports: ties, and regions too small to be trusted.
//!
//! 1. Of the pixels without a flag, those whose runner-up has the belief of the best label,
//!    [`RunnerUp`](crate::backend::Map::RunnerUp) = [`Best`](crate::backend::Map::Best), get
//!    [`TIE`](crate::maps::flag::TIE).
//! 2. The pixels that are still without a flag form regions: two that share a side are connected
//!    where their labels differ by at most 1.
//! 3. All pixels of a region of fewer than
//!    [`speckle_size`](crate::options::RefinementOptions::speckle_size) pixels get
//!    [`SPECKLE`](crate::maps::flag::SPECKLE).
//!
//! (A tie says that nothing tells the labels apart, as where an image is overexposed. The best
//! label is then merely the lowest, in regions that may be large.)

use super::{Data, Descriptor, Map, maps};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| maps(&[Map::Label, Map::Best, Map::RunnerUp, Map::Validity]),
    writes: |_| maps(&[Map::Validity]),
    needs: |_| vec![Data::Parents, Data::Sizes],
    taken: |method| method.refinement.speckle_size > 0,
    pixel: 15.0,
    ..Descriptor::NONE
};
