//! Memory that is taken step by step: that of images while they are read.

use std::sync::atomic::{AtomicU64, Ordering};

use super::check;
use crate::error::{MemoryError, Purpose, Result};
use crate::process::PerProcess;

/// Bytes that are claimed at present.
static CLAIMED: PerProcess<AtomicU64> = PerProcess::new();

/// Memory that an operation takes step by step during the life of the claim. Other claims do not count on it.
pub(crate) struct Claim(u64);

impl Claim {
    /// Claims `bytes` for work on an image.
    ///
    /// # Errors
    /// The errors of [`check`], for this claim and for the sum of all claims.
    pub(crate) fn new(bytes: u64) -> Result<Self, MemoryError> {
        // Check the claim by itself first, so that the error of one that is too large never depends on others.
        check(bytes, Purpose::Image)?;
        let claim = Self(bytes);
        let others = CLAIMED.get().fetch_add(bytes, Ordering::Relaxed);
        // On failure, dropping the claim subtracts it.
        check(others.saturating_add(bytes), Purpose::Image).map(|()| claim)
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        CLAIMED.get().fetch_sub(self.0, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::super::available;
    use super::*;

    #[test]
    fn claims_add_up() {
        let Some(free) = available() else { return };
        let share = free / 3 * 2;
        let first = Claim::new(share).unwrap();
        assert!(Claim::new(share).is_err(), "both together are too much");
        assert!(Claim::new(u64::MAX).is_err());
        drop(first);
        // Other tests claim memory at the same time, so only this shows that the first claim is gone.
        drop(Claim::new(share).unwrap());
    }
}
