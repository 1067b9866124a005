//! The label of each pixel of level 0, its belief, and the best belief of another surface (beliefs are costs).
//!
//! Among the labels k that the pixel [has](super::label_window), with b(k) their beliefs:
//!
//! ```text
//! Label    = the k of smallest b(k), the lowest on ties
//! Best     = b(Label)
//! RunnerUp = min of b(k) over |k - Label| > 1        NO_RUNNER_UP, 65535, if there is no such k
//! ```
//!
//! These are the maps [`Label`](crate::backend::Map::Label), [`Best`](crate::backend::Map::Best)
//! and [`RunnerUp`](crate::backend::Map::RunnerUp).

use super::{Data, Descriptor, Map, Volume, maps};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| vec![Data::Volume(Volume::Belief(0)), Data::Windows(0)],
    writes: |_| maps(&[Map::Label, Map::Best, Map::RunnerUp]),
    reach: Some(0),
    cell: 0.25,
    ..Descriptor::NONE
};
