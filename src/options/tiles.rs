//! Options of matching in tiles.

use super::row::{options, whole};

/// The most memory that a match may be given, in MiB: 16 TiB.
pub const MAX_MEMORY: u32 = 1 << 24;

options! {
    /// When a pair is cut into tiles.
    "tiles" TileOptions {
        /// Memory that a match may take. A pair that needs more is matched in tiles, and its maps differ a little from those
        /// of a match in one piece. The cuts follow from size, range and method alone.
        memory: u32 = 4096, takes whole(1..=MAX_MEMORY), unit "MiB", source "not in the paper";
    }
}
