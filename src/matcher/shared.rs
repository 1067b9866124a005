//! A matcher for several threads and for forked processes.

use super::{Builder, Matcher};
use crate::error::Result;
use crate::image::Pair;
use crate::process::PerProcess;
use crate::threads::Threads;
use std::sync::{Arc, Mutex, PoisonError};

/// A matcher that several threads use in turns. A forked process makes its own with the same configuration,
/// because the threads and the device of a matcher do not survive a fork.
pub struct SharedMatcher {
    builder: Builder,
    threads: Arc<Threads>,
    own: PerProcess<Mutex<Option<Matcher>>>,
}

impl SharedMatcher {
    /// Opens the device.
    ///
    /// # Errors
    /// The errors of [`Builder::build`].
    pub fn new(builder: Builder) -> Result<Self> {
        let shared = Self::unopened(builder)?;
        shared.turn(|_| Ok(()))?;
        Ok(shared)
    }

    /// A matcher that opens the device in its first [turn](Self::turn).
    ///
    /// # Errors
    /// [`ExecutionError`](crate::error::ExecutionError) for a number of threads out of range.
    pub fn unopened(builder: Builder) -> Result<Self> {
        let threads = Arc::new(Threads::new(builder.execution.threads)?);
        Ok(Self { builder, threads, own: PerProcess::new() })
    }

    /// Runs `work` with the matcher, once no other thread uses it.
    ///
    /// # Errors
    /// The error of `work`, and, if it is the first turn in this process, the errors of [`Builder::build`].
    pub fn turn<T>(&self, work: impl FnOnce(&mut Matcher) -> Result<T>) -> Result<T> {
        let mut own = self.own.get().lock().unwrap_or_else(PoisonError::into_inner);
        let matcher = match own.take() {
            Some(matcher) => matcher,
            None => pollster::block_on(self.builder.clone().build_on(Arc::clone(&self.threads)))?,
        };
        work(own.insert(matcher))
    }

    /// Runs `work` for `pair`, such as [checks](crate::check), on the matcher's threads, without waiting.
    ///
    /// # Errors
    /// [`ExecutionError`](crate::error::ExecutionError) if the system does not start the threads.
    pub fn share<T: Send>(&self, pair: &Pair, work: impl FnOnce() -> T + Send) -> Result<T> {
        self.share_of(pair.size(), work)
    }

    /// Like [`SharedMatcher::share`], for a pair of (width, height) pixels, such as one that `work` reads.
    ///
    /// # Errors
    /// [`ExecutionError`](crate::error::ExecutionError) if the system does not start the threads.
    pub fn share_of<T: Send>(
        &self,
        (width, height): (usize, usize),
        work: impl FnOnce() -> T + Send,
    ) -> Result<T> {
        Ok(self.threads.pool(width * height)?.install(work))
    }
}
