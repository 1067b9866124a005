//! Takes the disparity that a [prior](crate::prior) gives for pixels without a trusted match.
//!
//! A pixel that has a flag of [`INVALID`](crate::maps::flag::INVALID), is not masked, and has an
//! [`Anchor`](crate::backend::Map::Anchor) takes that as its [`Disparity`](crate::backend::Map::Disparity). It loses its flags and
//! gets [`FILLED`](crate::maps::flag::FILLED) alone, which marks the pixels that a prior decided, and a confidence of
//! `ANCHOR_CONFIDENCE`. All other pixels stay. Later stages treat anchors like measured pixels, so that the pixels around them are
//! filled from them.

use super::{Descriptor, Map, maps};

/// The confidence of an anchor: the lead of a label over its runner-up by 8 nats.
pub(crate) const ANCHOR_CONFIDENCE: u8 = 64;

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| maps(&[Map::Anchor, Map::Disparity, Map::Validity, Map::Confidence]),
    writes: |_| maps(&[Map::Disparity, Map::Validity, Map::Confidence]),
    taken: |plan| plan.prior,
    pixel: 2.0,
    ..Descriptor::NONE
};
