//! Where a matcher's own work runs: on threads of its own, in a browser on the one that there is.

use crate::error::{ExecutionError, Result};
use crate::options::Execution;
#[cfg(not(target_arch = "wasm32"))]
use crate::{error::Purpose, memory};

/// Bytes of a thread's stack.
#[cfg(not(target_arch = "wasm32"))]
const STACK: u64 = 2 << 20;

/// Refuses numbers of threads that there may not be.
fn check(count: Option<usize>) -> Result<()> {
    const MOST: usize = Execution::MOST_THREADS;
    match count.filter(|count| !(1..=MOST).contains(count)) {
        Some(wanted) => Err(ExecutionError::ThreadCount { wanted, most: MOST }.into()),
        None => Ok(()),
    }
}

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
    /// [`ExecutionError`] for none at all, for more than [`Execution::MOST_THREADS`], and for more than the system has;
    /// [`MemoryError`](crate::error::MemoryError) where their stacks do not fit.
    pub(super) fn new(count: Option<usize>) -> Result<Self> {
        check(count)?;
        let least = count.map_or(1, |count| count as u64);
        memory::check(least.saturating_mul(STACK), Purpose::Match)?;
        // 0 stands for as many as there are cores.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count.unwrap_or(0)).stack_size(STACK as usize);
        let pool = pool.build().map_err(|e| ExecutionError::Threads(e.to_string()))?;
        // A thread takes memory when it begins. All have begun before anybody counts what is left.
        pool.broadcast(|_| ());
        Ok(Self { pool })
    }

    /// Does `work` there. Who awaits this waits for it.
    #[allow(clippy::unused_async, reason = "it has something to await in a browser")]
    pub(super) async fn run<T: Send>(&self, work: impl AsyncFnOnce() -> T + Send) -> T {
        self.pool.install(|| pollster::block_on(work()))
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Runs `begin` in the current thread, and waits for what it has spawned there.
    pub(super) fn scope<'scope, T>(&self, begin: impl FnOnce(&rayon::Scope<'scope>) -> T) -> T {
        self.pool.in_place_scope(begin)
    }
}

#[cfg(target_arch = "wasm32")]
impl Threads {
    pub(super) fn new(count: Option<usize>) -> Result<Self> {
        check(count).map(|()| Self {})
    }

    pub(super) async fn run<T>(&self, work: impl AsyncFnOnce() -> T) -> T {
        work().await
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;

    #[test]
    fn numbers_that_no_machine_has_are_refused() {
        for wanted in [0, 1025, usize::MAX] {
            let Err(Error::Execution(error)) = Threads::new(Some(wanted)) else { panic!("{wanted}") };
            assert_eq!(error, ExecutionError::ThreadCount { wanted, most: 1024 });
        }
        assert!(Threads::new(Some(1)).is_ok() && Threads::new(None).is_ok());
    }
}
