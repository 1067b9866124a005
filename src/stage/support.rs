//! The final [`Confidence`](crate::backend::Map::Confidence) of each measured pixel: its support by the pixels around it. (Pixels
//! that [`far_plane`](super::far_plane) outvotes because of it are no longer measured.)
//!
//! The margin between labels is blind to the neighbourhood: beside an edge, or in a patch of wrong matches,
//! it may be large. With C the confidence and D the disparity before the stage, a valid pixel p gets the mean
//!
//! ```text
//! (sum over its places n of C(n) where |D(n) - D(p)| <= 2 px) / 25          rounded down
//! ```
//!
//! Its places are the 5 x 5 pixels up to 4 columns and rows away, two pixels apart, clamped to the image.
//! Pixels with a flag of [`INVALID`](crate::maps::flag::INVALID) get 0.
//!
//! Valid pixels below [`confidence_floor`](crate::options::RefinementOptions::confidence_floor) get
//! [`LOW_CONFIDENCE`](crate::maps::flag::LOW_CONFIDENCE); they stay valid.

use super::{Data, Descriptor, Map, maps};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| maps(&[Map::Disparity, Map::Validity, Map::Confidence]),
    writes: |_| maps(&[Map::Confidence, Map::Validity]),
    needs: |_| vec![Data::NextFlags],
    pixel: 14.0,
    ..Descriptor::NONE
};
