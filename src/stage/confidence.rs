//! The [`Confidence`](crate::backend::Map::Confidence) of a pixel: the lead of its label over the runner-up.
//!
//! ```text
//! confidence = min(2 (RunnerUp - Best), 255)         for valid pixels; 255 without a runner-up
//!              0                                     for pixels with a flag of INVALID
//! ```
//!
//! The unit is half a unit of belief, which is an eighth of a nat. Votes weight pixels by it; then
//! [`support`](super::support) replaces it by the support of the neighbourhood, the weight in
//! [`far_plane`](super::far_plane).

use super::{Descriptor, Map, maps};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| maps(&[Map::Best, Map::RunnerUp, Map::Validity]),
    writes: |_| maps(&[Map::Confidence]),
    pixel: 0.5,
    ..Descriptor::NONE
};
