//! Memory for volumes in a browser, which has pages of one size.

use crate::error::{MemoryError, Purpose, Result};
use bytemuck::Pod;
use std::ops::{Deref, DerefMut};

/// Values that are 0 at first.
pub(super) struct Pages<T>(Vec<T>);

impl<T: Pod> Pages<T> {
    /// `len` values.
    ///
    /// # Errors
    /// [`MemoryError::Machine`] when there is not as much memory.
    pub(super) fn new(len: usize) -> Result<Self, MemoryError> {
        let needed = len as u64 * size_of::<T>() as u64;
        let lacking = |_| MemoryError::Machine { needed, available: None, purpose: Purpose::Match };
        let mut values = Vec::new();
        values.try_reserve_exact(len).map_err(lacking)?;
        values.resize(len, T::zeroed());
        Ok(Self(values))
    }
}

impl<T> Default for Pages<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> Deref for Pages<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.0
    }
}

impl<T> DerefMut for Pages<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.0
    }
}
