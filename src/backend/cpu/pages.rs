//! Memory for volumes.

use crate::error::MemoryError;
#[cfg(target_arch = "wasm32")]
pub(super) use browser::Pages;
#[cfg(not(target_arch = "wasm32"))]
pub(super) use native::Pages;

/// The error where the system does not have `size` bytes.
fn lacking(size: usize) -> MemoryError {
    MemoryError::Machine { needed: size as u64, available: None, purpose: crate::error::Purpose::Match }
}

#[cfg(not(target_arch = "wasm32"))]
mod native {
    use super::lacking;
    use crate::error::{MemoryError, Result};
    use bytemuck::Pod;
    use memmap2::MmapMut;
    use std::marker::PhantomData;
    use std::ops::{Deref, DerefMut};

    /// Values that are 0 at first, in large pages where the system has them. Small pages are allocated one by one
    /// at their first access, and that takes longer than a match.
    pub(in crate::backend::cpu) struct Pages<T> {
        /// `None` where there are no values.
        bytes: Option<MmapMut>,
        values: PhantomData<T>,
    }

    impl<T: Pod> Pages<T> {
        /// `len` values.
        ///
        /// # Errors
        /// [`MemoryError::Machine`] when the system does not have as much memory.
        pub(in crate::backend::cpu) fn new(len: usize) -> Result<Self, MemoryError> {
            let size = len * size_of::<T>();
            if size == 0 {
                return Ok(Self { bytes: None, values: PhantomData });
            }
            let bytes = MmapMut::map_anon(size).map_err(|_| lacking(size))?;
            // Only a hint: a system without large pages gives small ones.
            #[cfg(target_os = "linux")]
            let _ = bytes.advise(memmap2::Advice::HugePage);
            Ok(Self { bytes: Some(bytes), values: PhantomData })
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
}

#[cfg(target_arch = "wasm32")]
mod browser {
    use super::lacking;
    use crate::error::{MemoryError, Result};
    use bytemuck::Pod;
    use std::ops::{Deref, DerefMut};

    /// Values that are 0 at first. A browser has pages of one size.
    pub(in crate::backend::cpu) struct Pages<T>(Vec<T>);

    impl<T: Pod> Pages<T> {
        /// `len` values.
        ///
        /// # Errors
        /// [`MemoryError::Machine`] when there is not as much memory.
        pub(in crate::backend::cpu) fn new(len: usize) -> Result<Self, MemoryError> {
            let size = len.checked_mul(size_of::<T>()).unwrap_or(usize::MAX);
            let mut values = Vec::new();
            values.try_reserve_exact(len).map_err(|_| lacking(size))?;
            values.resize(len, T::zeroed());
            Ok(Self(values))
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
}
