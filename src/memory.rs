//! The memory of the machine, and allocations that can fail.

#[cfg(feature = "files")]
mod claims;

#[cfg(feature = "files")]
pub(crate) use claims::Claim;

use crate::error::{MemoryError, Purpose, Result};
use std::sync::Mutex;
use std::time::Duration;
use web_time::Instant;

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

/// How long a reading of the available memory counts: to read it again for each of several checks of a pair would
/// take longer than other work of the host.
const COUNTS: Duration = Duration::from_secs(1);

/// When the available memory was read, and what is left of it after all that was granted since.
static READING: Mutex<Option<(Instant, u64)>> = Mutex::new(None);

/// Bytes that are available, if the system tells: exactly if that may decide whether there is room for `asked`
/// bytes, otherwise by the last reading.
fn available_for(asked: u64) -> Option<u64> {
    // A lock that a fork has copied while it was held is never free again.
    let Ok(mut reading) = READING.try_lock() else { return available() };
    let recent = reading.filter(|(read, left)| read.elapsed() < COUNTS && left / 2 >= asked);
    let (read, free) = match recent {
        Some(recent) => recent,
        None => (Instant::now(), available()?),
    };
    *reading = Some((read, free.saturating_sub(asked)));
    Some(free)
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
    if let Some(free) = available_for(bytes).filter(|free| bytes > *free) {
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
        // The reading behind that grant does not grant more than there is.
        assert!(check(1 << 55, Purpose::Match).is_err());
    }
}
