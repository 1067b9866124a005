//! Exchanges and mirrors the views: the right view becomes the left one, with its matches to the left again,
//! so that [`cost`](super::cost), [`sub_pixel`](super::sub_pixel) and the map stages can process it.
//!
//! With x' = width - 1 - x, all at once:
//!
//! ```text
//! left(x, y)       = right(x', y)           right(x, y)      = left(x', y)      pixels and masks
//! Label(x, y)      = RightLabel(x', y)      RightLabel(x, y) = Label(x', y)
//! Best(x, y)       = RightBest(x', y)       RightBest(x, y)  = Best(x', y)
//! RunnerUp(x, y)   = 65535 (none)
//! ```
//!
//! (The runners-up of the right view are unknown.)

use super::{Data, Descriptor, Map, maps};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| [maps(&[Map::Label, Map::Best, Map::RightLabel, Map::RightBest]), views()].concat(),
    writes: |_| {
        let maps = maps(&[Map::Label, Map::Best, Map::RunnerUp, Map::RightLabel, Map::RightBest]);
        [maps, views()].concat()
    },
    pixel: 4.0,
    ..Descriptor::NONE
};

/// Both views, at the sizes that exist.
fn views() -> Vec<Data> {
    vec![Data::LEFT, Data::Right, Data::FullLeft, Data::FullRight]
}
