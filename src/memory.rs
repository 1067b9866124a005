//! How much memory there is to ask for, and memory that can be refused.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::error::{MemoryError, Purpose, Result};
use crate::process::PerProcess;

/// Bytes that can be had without swapping, where the system says so.
#[cfg(not(target_arch = "wasm32"))]
fn available() -> Option<u64> {
    let mut system = sysinfo::System::new();
    system.refresh_memory_specifics(sysinfo::MemoryRefreshKind::nothing().with_ram());
    // In a root without /proc there is nothing to read.
    let known = sysinfo::IS_SUPPORTED_SYSTEM && system.total_memory() > 0;
    known.then(|| system.available_memory())
}

/// A browser does not say.
#[cfg(target_arch = "wasm32")]
fn available() -> Option<u64> {
    None
}

/// Addresses that may be gone at the next allocation of a thread: glibc gives a thread a heap of its own, of this size, as soon
/// as it finds room for it.
const HEAP: usize = if cfg!(all(target_os = "linux", target_env = "gnu")) { 64 << 20 } else { 0 };

/// Declines to take `bytes` that this machine cannot give, or does not let this process have: the system would end the process
/// without a word.
///
/// # Errors
/// [`MemoryError::Machine`] with both figures, where both are known.
pub(crate) fn check(bytes: u64, purpose: Purpose) -> Result<(), MemoryError> {
    if let Some(free) = available().filter(|free| bytes > *free) {
        return Err(MemoryError::Machine { needed: bytes, available: Some(free), purpose });
    }
    // Limits of the process (`ulimit -v`) and of a system that does not overcommit: what is never touched costs nothing.
    let with_heap = usize::try_from(bytes).unwrap_or(usize::MAX).saturating_add(HEAP);
    Vec::<u8>::new().try_reserve_exact(with_heap).map_err(|_| lacking(bytes, purpose))
}

/// Bytes that have been claimed.
static CLAIMED: PerProcess<AtomicU64> = PerProcess::new();

/// Memory that somebody takes, step by step, while this lives: other claims must do without it.
pub(crate) struct Claim(u64);

impl Claim {
    /// Claims `bytes` for what is done to an image.
    ///
    /// # Errors
    /// Those of [`check`], of this claim and of all claims together.
    pub(crate) fn new(bytes: u64) -> Result<Self, MemoryError> {
        // Alone first: what is too much in any case is told in the same way whatever others claim at this moment.
        check(bytes, Purpose::Image)?;
        let claim = Self(bytes);
        let others = CLAIMED.get().fetch_add(bytes, Ordering::Relaxed);
        // Where it fails the claim is dropped.
        check(others.saturating_add(bytes), Purpose::Image).map(|()| claim)
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        CLAIMED.get().fetch_sub(self.0, Ordering::Relaxed);
    }
}

fn lacking(bytes: u64, purpose: Purpose) -> MemoryError {
    MemoryError::Machine { needed: bytes, available: None, purpose }
}

/// An empty vector with room for `count` values.
///
/// # Errors
/// [`MemoryError::Machine`] when the system has not as much.
pub(crate) fn reserved<T>(count: usize) -> Result<Vec<T>, MemoryError> {
    let mut out = Vec::new();
    let bytes = (count as u64).saturating_mul(size_of::<T>() as u64);
    out.try_reserve_exact(count).map_err(|_| lacking(bytes, Purpose::Image))?;
    Ok(out)
}

/// A vector of `count` times `value`.
///
/// # Errors
/// [`MemoryError::Machine`] when the system has not as much.
pub(crate) fn filled<T: Clone>(count: usize, value: T) -> Result<Vec<T>, MemoryError> {
    let mut out = reserved(count)?;
    out.resize(count, value);
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_machine_has_is_declined() {
        for bytes in [1 << 55, u64::MAX] {
            let said = check(bytes, Purpose::Image).unwrap_err().to_string();
            assert!(said.contains("GiB of memory are needed") && !said.contains('\n'), "{said}");
        }
        assert!(filled(usize::MAX / 8, 0_u64).is_err());
        assert_eq!(filled(3, 7).unwrap(), [7; 3]);
        check(1 << 20, Purpose::Match).unwrap();
    }

    #[test]
    fn claims_add_up() {
        let Some(free) = available() else { return };
        let share = free / 3 * 2;
        let first = Claim::new(share).unwrap();
        assert!(Claim::new(share).is_err(), "both together are too much");
        assert!(Claim::new(u64::MAX).is_err());
        drop(first);
        assert_eq!(CLAIMED.get().load(Ordering::Relaxed), 0);
        drop(Claim::new(share).unwrap());
    }
}
