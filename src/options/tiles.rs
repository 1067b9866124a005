//! Options of matching in tiles.

use super::row::{options, whole};

/// Most memory that a match may be given, in MiB: 16 TiB.
pub const MAX_MEMORY: u32 = 1 << 24;

/// Parses a size of memory, such as "2GiB" or "512MiB", in MiB.
///
/// # Errors
/// A message that says what to give instead.
pub fn mebibytes(text: &str) -> Result<u32, String> {
    let units = [("MiB", 0), ("GiB", 10), ("TiB", 20)];
    let size = units.into_iter().find_map(|(unit, shift)| {
        let count: u64 = text.strip_suffix(unit)?.trim_end().parse().ok()?;
        u32::try_from(count.checked_mul(1 << shift)?).ok()
    });
    let size = size.filter(|size| (1..=MAX_MEMORY).contains(size));
    size.ok_or_else(|| "give a whole number of MiB, GiB or TiB, from 1MiB to 16TiB, like 2GiB".into())
}

options! {
    /// When a pair is cut into tiles.
    "tiles" TileOptions {
        /// Memory that a match may take. A pair that needs more is matched in tiles, and its maps differ a little from those
        /// of a match in one piece. The cuts follow from size, range and method alone.
        memory: u32 = 4096, takes whole(1..=MAX_MEMORY), unit "MiB", source "not in the paper";
    }
}
