//! The [`Confidence`](crate::backend::Map::Confidence) of each pixel by itself: by how much its label leads.
//!
//! ```text
//! confidence = min(2 (RunnerUp - Best), 255)         for valid pixels; 255 without a runner-up
//!              0                                     for pixels with a flag of INVALID
//! ```
//!
//! It counts half units of belief, which are eighths of a nat. Votes weight pixels by it, and then
//! [`support`](super::support) makes it that of its surroundings, by which [`far_plane`](super::far_plane) weights them.

use super::{Descriptor, Map, maps};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| maps(&[Map::Best, Map::RunnerUp, Map::Validity]),
    writes: |_| maps(&[Map::Confidence]),
    pixel: 4.0,
    ..Descriptor::NONE
};
