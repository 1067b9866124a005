//! The calls of `rayon` that share a loop among threads, as plain loops. A browser has one thread, and the code that would hand out the
//! work makes the engine of the page larger.

use std::slice;

/// One after the other.
pub(crate) fn join<A, B>(a: impl FnOnce() -> A, b: impl FnOnce() -> B) -> (A, B) {
    (a(), b())
}

/// The only one.
pub(crate) fn current_num_threads() -> usize {
    1
}

/// Loops over slices.
pub(crate) trait Slice<T> {
    fn par_iter(&self) -> slice::Iter<'_, T>;
    fn par_iter_mut(&mut self) -> slice::IterMut<'_, T>;
    fn par_chunks(&self, size: usize) -> slice::Chunks<'_, T>;
    fn par_chunks_mut(&mut self, size: usize) -> slice::ChunksMut<'_, T>;
    fn par_chunks_exact_mut(&mut self, size: usize) -> slice::ChunksExactMut<'_, T>;
    #[cfg(feature = "paper")]
    fn par_chunk_by<F: FnMut(&T, &T) -> bool>(&self, joins: F) -> slice::ChunkBy<'_, T, F>;
}

impl<T> Slice<T> for [T] {
    fn par_iter(&self) -> slice::Iter<'_, T> {
        self.iter()
    }

    fn par_iter_mut(&mut self) -> slice::IterMut<'_, T> {
        self.iter_mut()
    }

    fn par_chunks(&self, size: usize) -> slice::Chunks<'_, T> {
        self.chunks(size)
    }

    fn par_chunks_mut(&mut self, size: usize) -> slice::ChunksMut<'_, T> {
        self.chunks_mut(size)
    }

    fn par_chunks_exact_mut(&mut self, size: usize) -> slice::ChunksExactMut<'_, T> {
        self.chunks_exact_mut(size)
    }

    #[cfg(feature = "paper")]
    fn par_chunk_by<F: FnMut(&T, &T) -> bool>(&self, joins: F) -> slice::ChunkBy<'_, T, F> {
        self.chunk_by(joins)
    }
}

/// Loops over vectors and ranges.
pub(crate) trait IntoLoop: IntoIterator + Sized {
    fn into_par_iter(self) -> Self::IntoIter {
        self.into_iter()
    }
}

impl<I: IntoIterator> IntoLoop for I {}

/// Methods of parallel iterators that plain iterators lack.
pub(crate) trait Loop: Iterator + Sized {
    fn with_min_len(self, _: usize) -> Self {
        self
    }

    fn for_each_init<S>(self, init: impl FnOnce() -> S, mut act: impl FnMut(&mut S, Self::Item)) {
        let mut kept = init();
        self.for_each(|item| act(&mut kept, item));
    }

    fn map_init<S, R>(
        self,
        init: impl FnOnce() -> S,
        mut of: impl FnMut(&mut S, Self::Item) -> R,
    ) -> impl Iterator<Item = R> {
        let mut kept = init();
        self.map(move |item| of(&mut kept, item))
    }

    fn flat_map_iter<R: IntoIterator>(
        self,
        of: impl FnMut(Self::Item) -> R,
    ) -> impl Iterator<Item = R::Item> {
        self.flat_map(of)
    }
}

impl<I: Iterator> Loop for I {}
