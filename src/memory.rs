//! The memory of the machine, and allocations that can fail.

#[cfg(feature = "files")]
mod claims;

#[cfg(feature = "files")]
pub(crate) use claims::Claim;

use crate::error::{MemoryError, Purpose, Result};

/// Bytes that are available without swapping, if the system tells.
#[cfg(not(target_arch = "wasm32"))]
fn available() -> Option<u64> {
    let mut system = sysinfo::System::new();
    system.refresh_memory_specifics(sysinfo::MemoryRefreshKind::nothing().with_ram());
    // Without /proc there is nothing to read.
    let known = sysinfo::IS_SUPPORTED_SYSTEM && system.total_memory() > 0;
    known.then(|| system.available_memory())
}

/// Unknown in browsers.
#[cfg(target_arch = "wasm32")]
fn available() -> Option<u64> {
    None
}

/// Address space that the next allocation of a thread may take: glibc reserves a heap of this size for each
/// thread.
const HEAP: usize = if cfg!(all(target_os = "linux", target_env = "gnu")) { 64 << 20 } else { 0 };

/// Refuses `bytes` that this machine does not have, or denies to this process; otherwise the system may kill
/// the process without a message.
///
/// # Errors
/// [`MemoryError::Machine`] with both figures, if both are known.
pub(crate) fn check(bytes: u64, purpose: Purpose) -> Result<(), MemoryError> {
    if let Some(free) = available().filter(|free| bytes > *free) {
        return Err(MemoryError::Machine { needed: bytes, available: Some(free), purpose });
    }
    // Catches limits of the process (`ulimit -v`) and systems that do not overcommit. Untouched memory costs nothing.
    let with_heap = usize::try_from(bytes).unwrap_or(usize::MAX).saturating_add(HEAP);
    Vec::<u8>::new().try_reserve_exact(with_heap).map_err(|_| lacking(bytes, purpose))
}

fn lacking(bytes: u64, purpose: Purpose) -> MemoryError {
    MemoryError::Machine { needed: bytes, available: None, purpose }
}

/// An empty vector with room for `count` values.
///
/// # Errors
/// [`MemoryError::Machine`] when the system has too little.
pub(crate) fn reserved<T>(count: usize) -> Result<Vec<T>, MemoryError> {
    let mut out = Vec::new();
    let bytes = (count as u64).saturating_mul(size_of::<T>() as u64);
    out.try_reserve_exact(count).map_err(|_| lacking(bytes, Purpose::Image))?;
    Ok(out)
}

/// A vector of `count` times `value`.
///
/// # Errors
/// [`MemoryError::Machine`] when the system has too little.
#[cfg(feature = "files")]
pub(crate) fn filled<T: Clone>(count: usize, value: T) -> Result<Vec<T>, MemoryError> {
    let mut out = reserved(count)?;
    out.resize(count, value);
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_amounts_are_refused() {
        for bytes in [1 << 55, u64::MAX] {
            let said = check(bytes, Purpose::Image).unwrap_err().to_string();
            assert!(said.contains("GiB of memory are needed") && !said.contains('\n'), "{said}");
        }
        assert!(filled(usize::MAX / 8, 0_u64).is_err());
        assert_eq!(filled(3, 7).unwrap(), [7; 3]);
        check(1 << 20, Purpose::Match).unwrap();
    }
}
