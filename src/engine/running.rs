//! The work of a backend for a running match.

use crate::backend::{Backend, Traffic};

/// The current frame, and the work for all frames so far.
#[derive(Default)]
pub(super) struct Running {
    /// The frame that was entered last.
    pub(super) frame: usize,
    /// Whether the backend's work for it is yet to be counted.
    is_uncounted: bool,
    /// Iterations of the frame, and the most of any in this look at this size.
    pub(super) iterations: u32,
    pub(super) most_iterations: u32,
    /// Iterations of the looks and sizes that are done.
    pub(super) earlier_iterations: u32,
    pub(super) traffic: Traffic,
    /// [`Backend::cells`] of each level at the pair's own size, summed over all tiles.
    pub(super) cells: Vec<u64>,
}

impl Running {
    /// Starts the work for `frame`.
    pub(super) fn enter(&mut self, frame: usize) {
        (self.frame, self.is_uncounted, self.iterations) = (frame, true, 0);
    }

    /// Takes the iterations of the frame, of which `idle` ran after the map had settled.
    pub(super) fn settle(&mut self, idle: u32) {
        self.most_iterations = self.most_iterations.max(self.iterations - idle);
    }

    /// Ends a look of all tiles, or the match at the pair's own size.
    pub(super) fn end_round(&mut self) {
        self.earlier_iterations += std::mem::take(&mut self.most_iterations);
    }

    /// Counts the work of `backend` for the frame, once.
    pub(super) fn count(&mut self, backend: &dyn Backend, is_own_size: bool) {
        if !std::mem::take(&mut self.is_uncounted) {
            return;
        }
        self.traffic += backend.traffic();
        if is_own_size {
            let cells = backend.cells();
            self.cells.resize(cells.len(), 0);
            self.cells.iter_mut().zip(cells).for_each(|(sum, more)| *sum += more);
        }
    }
}
