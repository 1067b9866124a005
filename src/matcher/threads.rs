//! Where a matcher's own work runs: on threads of its own, in a browser on the one that there is.

use crate::error::{ExecutionError, Result};

/// The threads of a matcher.
pub(super) struct Threads {
    #[cfg(not(target_arch = "wasm32"))]
    pool: rayon::ThreadPool,
}

#[cfg(not(target_arch = "wasm32"))]
impl Threads {
    /// So many threads, or one for each core.
    ///
    /// # Errors
    /// [`ExecutionError`] for none at all, and for more than the system has.
    pub(super) fn new(count: Option<usize>) -> Result<Self, ExecutionError> {
        let mut pool = rayon::ThreadPoolBuilder::new();
        if let Some(count) = count {
            if count == 0 {
                return Err(ExecutionError::NoThreads);
            }
            pool = pool.num_threads(count);
        }
        let pool = pool.build().map_err(|e| ExecutionError::Threads(e.to_string()))?;
        Ok(Self { pool })
    }

    /// Does `work` there. Who awaits this waits for it.
    #[allow(clippy::unused_async, reason = "it has something to await in a browser")]
    pub(super) async fn run<T: Send>(&self, work: impl AsyncFnOnce() -> T + Send) -> T {
        self.pool.install(|| pollster::block_on(work()))
    }
}

#[cfg(target_arch = "wasm32")]
impl Threads {
    pub(super) fn new(count: Option<usize>) -> Result<Self, ExecutionError> {
        match count {
            Some(0) => Err(ExecutionError::NoThreads),
            _ => Ok(Self {}),
        }
    }

    pub(super) async fn run<T>(&self, work: impl AsyncFnOnce() -> T) -> T {
        work().await
    }
}
