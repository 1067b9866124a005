//! Sizes of memory, as users give them.

use mrfgs::options::MAX_MEMORY;

/// A size of memory, in MiB.
///
/// # Errors
/// What to give instead, for anything but a whole number of a unit within [`MAX_MEMORY`].
pub(crate) fn mebibytes(text: &str) -> Result<u32, String> {
    let units = [("MiB", 0), ("GiB", 10), ("TiB", 20)];
    let size = units.into_iter().find_map(|(unit, shift)| {
        let count: u64 = text.strip_suffix(unit)?.trim_end().parse().ok()?;
        u32::try_from(count.checked_mul(1 << shift)?).ok()
    });
    let size = size.filter(|size| (1..=MAX_MEMORY).contains(size));
    size.ok_or_else(|| "give a whole number of MiB, GiB or TiB, from 1MiB to 16TiB, like 2GiB".into())
}
