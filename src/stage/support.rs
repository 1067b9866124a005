//! The final [`Confidence`](crate::backend::Map::Confidence) of each measured pixel: what the pixels around it support. (Those that
//! [`far_plane`](super::far_plane) outvotes by it are then no longer measured.)
//!
//! A margin between labels knows nothing of its surroundings. Beside an edge, or within a patch of wrong matches, a pixel may lead by
//! far. So with C the confidence and D the disparity before the stage, a valid pixel p gets the mean
//!
//! ```text
//! (sum over its places n of C(n) where |D(n) - D(p)| <= 2 px) / 25          rounded down
//! ```
//!
//! Its places are the 5 x 5 pixels up to 4 columns and rows away, two pixels apart. One outside the image counts as the nearest
//! pixel inside. Pixels with a flag of [`INVALID`](crate::maps::flag::INVALID) get 0.
//!
//! Valid pixels below [`confidence_floor`](crate::options::RefinementOptions::confidence_floor) get
//! [`LOW_CONFIDENCE`](crate::maps::flag::LOW_CONFIDENCE); they stay valid.

use super::{Data, Descriptor, Map, maps};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| maps(&[Map::Disparity, Map::Validity, Map::Confidence]),
    writes: |_| maps(&[Map::Confidence, Map::Validity]),
    needs: |_| vec![Data::NextFlags],
    pixel: 10.0,
    ..Descriptor::NONE
};
