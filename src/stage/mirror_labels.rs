//! Turns the labels of the mirrored pair's match into those of the right view, for the left-right check. They
//! stay when the pair itself is prepared.
//!
//! ```text
//! RightLabel(x, y) = Label(width - 1 - x, y)
//! RightBest(x, y)  = Best(width - 1 - x, y)
//! ```

use super::{Descriptor, Map, maps};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| maps(&[Map::Label, Map::Best]),
    writes: |_| maps(&[Map::RightLabel, Map::RightBest]),
    pixel: 4.0,
    ..Descriptor::NONE
};
