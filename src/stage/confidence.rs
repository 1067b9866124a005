//! The [`Confidence`](crate::backend::Map::Confidence) of each pixel: by how much its label leads.
//!
//! ```text
//! confidence = min(2 (RunnerUp - Best), 255)         for valid pixels; 255 without a runner-up
//!              0                                     for pixels with a flag of INVALID
//! ```
//!
//! It counts half units of belief, which are eighths of a nat. Valid pixels below
//! [`confidence_floor`](crate::options::RefinementOptions::confidence_floor) get
//! [`LOW_CONFIDENCE`](crate::maps::flag::LOW_CONFIDENCE); they stay valid:
//! [`INVALID`](crate::maps::flag::INVALID) does not contain it.

use super::{Descriptor, Map, maps};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| maps(&[Map::Best, Map::RunnerUp, Map::Validity]),
    writes: |_| maps(&[Map::Confidence, Map::Validity]),
    pixel: 4.0,
    ..Descriptor::NONE
};
