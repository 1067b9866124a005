//! The bytes of a file: in memory, or on the disk, where only those are read that are needed.

use std::borrow::Cow;

#[cfg(not(target_arch = "wasm32"))]
use super::disk::Disk;
use crate::error::ReadError;

/// The bytes of a file.
#[derive(Clone, Copy)]
pub(super) enum Bytes<'a> {
    /// All of them are in memory.
    Held(&'a [u8]),
    /// They are read when they are needed.
    #[cfg(not(target_arch = "wasm32"))]
    OnDisk(&'a Disk),
}

impl<'a> Bytes<'a> {
    /// Their number.
    pub(super) fn len(self) -> u64 {
        match self {
            Self::Held(bytes) => bytes.len() as u64,
            #[cfg(not(target_arch = "wasm32"))]
            Self::OnDisk(file) => file.len(),
        }
    }

    /// `count` bytes from `start`; `None` where the file has fewer.
    ///
    /// # Errors
    /// That of the disk, or about memory.
    #[cfg_attr(target_arch = "wasm32", allow(clippy::unnecessary_wraps, reason = "memory is always read"))]
    pub(super) fn get(self, start: u64, count: u64) -> Result<Option<Cow<'a, [u8]>>, ReadError> {
        let Some(end) = start.checked_add(count).filter(|end| *end <= self.len()) else { return Ok(None) };
        Ok(Some(match self {
            // The end is within memory, so both numbers fit.
            Self::Held(bytes) => Cow::Borrowed(&bytes[start as usize..end as usize]),
            #[cfg(not(target_arch = "wasm32"))]
            Self::OnDisk(file) => Cow::Owned(file.read(start, count)?),
        }))
    }
}
