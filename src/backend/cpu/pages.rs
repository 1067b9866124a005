//! Memory for volumes.

use crate::error::{MemoryError, Purpose, Result};
use bytemuck::Pod;
use memmap2::MmapMut;
use std::marker::PhantomData;
use std::ops::{Deref, DerefMut};

/// Values initialized to 0, in huge pages if the system has them. Faulting in small pages one by one takes
/// longer than a match.
pub(super) struct Pages<T> {
    /// `None` if there are no values.
    bytes: Option<MmapMut>,
    values: PhantomData<T>,
}

impl<T: Pod> Pages<T> {
    /// `len` values.
    ///
    /// # Errors
    /// [`MemoryError::Machine`] when the system has too little memory.
    pub(super) fn new(len: usize) -> Result<Self, MemoryError> {
        let size = len * size_of::<T>();
        if size == 0 {
            return Ok(Self { bytes: None, values: PhantomData });
        }
        let bytes = MmapMut::map_anon(size).map_err(|_| MemoryError::Machine {
            needed: size as u64,
            available: None,
            purpose: Purpose::Match,
        })?;
        // Only a hint: systems without huge pages use small ones.
        #[cfg(target_os = "linux")]
        let _ = bytes.advise(memmap2::Advice::HugePage);
        Ok(Self { bytes: Some(bytes), values: PhantomData })
    }

    /// The same memory for values of another type; they are undefined.
    pub(super) fn of_others<V: Pod>(self) -> Pages<V> {
        Pages { bytes: self.bytes, values: PhantomData }
    }
}

impl<T> Default for Pages<T> {
    fn default() -> Self {
        Self { bytes: None, values: PhantomData }
    }
}

impl<T: Pod> Deref for Pages<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        // Pages are aligned for every type.
        self.bytes.as_ref().map_or(&[], |bytes| bytemuck::cast_slice(bytes))
    }
}

impl<T: Pod> DerefMut for Pages<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        self.bytes.as_mut().map_or(&mut [], |bytes| bytemuck::cast_slice_mut(bytes))
    }
}
