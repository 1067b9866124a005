//! A matcher for several threads, and for processes that are forked.

use super::{Builder, Matcher};
use crate::error::Result;
use crate::image::Pair;
use crate::process::PerProcess;
use crate::threads::Threads;
use std::sync::{Arc, Mutex, PoisonError};

/// A matcher that several threads use in turns. A process that is forked makes its own, by the same choices: the threads of a matcher do not
/// come along, and neither does its device.
pub struct SharedMatcher {
    builder: Builder,
    threads: Arc<Threads>,
    own: PerProcess<Mutex<Option<Matcher>>>,
}

impl SharedMatcher {
    /// Opens the device.
    ///
    /// # Errors
    /// Those of [`Builder::build`].
    pub fn new(builder: Builder) -> Result<Self> {
        let threads = Arc::new(Threads::new(builder.execution.threads)?);
        let shared = Self { builder, threads, own: PerProcess::new() };
        shared.turn(|_| Ok(()))?;
        Ok(shared)
    }

    /// Does `work` with the matcher, when no other thread uses it any more.
    ///
    /// # Errors
    /// That of `work`, and in another process than the first those of [`Builder::build`].
    pub fn turn<T>(&self, work: impl FnOnce(&mut Matcher) -> Result<T>) -> Result<T> {
        let mut own = self.own.get().lock().unwrap_or_else(PoisonError::into_inner);
        let matcher = match own.take() {
            Some(matcher) => matcher,
            None => pollster::block_on(self.builder.clone().build_on(Arc::clone(&self.threads)))?,
        };
        work(own.insert(matcher))
    }

    /// Does `work` around a match of `pair` on the threads of the matcher, such as [checks](crate::check). It waits for no match.
    ///
    /// # Errors
    /// [`ExecutionError`](crate::error::ExecutionError) where the system does not start the threads.
    pub fn share<T: Send>(&self, pair: &Pair, work: impl FnOnce() -> T + Send) -> Result<T> {
        let (width, height) = pair.size();
        Ok(self.threads.pool(width * height)?.install(work))
    }
}
