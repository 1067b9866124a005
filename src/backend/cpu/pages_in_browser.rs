//! Memory for volumes in browsers, which have one page size.

use crate::error::{MemoryError, Purpose, Result};
use bytemuck::Pod;
use std::marker::PhantomData;
use std::ops::{Deref, DerefMut};

/// Values initialized to 0.
pub(super) struct Pages<T> {
    /// Words, so that values of every type are aligned.
    words: Vec<u64>,
    values: PhantomData<T>,
}

impl<T: Pod> Pages<T> {
    /// `len` values.
    ///
    /// # Errors
    /// [`MemoryError::Machine`] when there is too little memory.
    pub(super) fn new(len: usize) -> Result<Self, MemoryError> {
        let needed = len as u64 * size_of::<T>() as u64;
        let lacking = |_| MemoryError::Machine { needed, available: None, purpose: Purpose::Match };
        let count = needed.div_ceil(8) as usize;
        let mut words = Vec::new();
        words.try_reserve_exact(count).map_err(lacking)?;
        words.resize(count, 0);
        Ok(Self { words, values: PhantomData })
    }

    /// The same memory for values of another type; they are undefined.
    pub(super) fn of_others<V: Pod>(self) -> Pages<V> {
        Pages { words: self.words, values: PhantomData }
    }
}

impl<T> Default for Pages<T> {
    fn default() -> Self {
        Self { words: Vec::new(), values: PhantomData }
    }
}

impl<T: Pod> Deref for Pages<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        bytemuck::cast_slice(&self.words)
    }
}

impl<T: Pod> DerefMut for Pages<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        bytemuck::cast_slice_mut(&mut self.words)
    }
}
