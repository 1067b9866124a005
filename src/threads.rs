//! The default number of threads, and the threads outside matchers.
//!
//! Each matcher has its own threads. All other parallel work (reading, rectification, checks) runs on one
//! pool of the process, or on the `rayon` pool from which it is called. A forked process makes its own pool.

#[cfg(not(target_arch = "wasm32"))]
use crate::error::Purpose;
use crate::error::{ExecutionError, Result};
#[cfg(not(target_arch = "wasm32"))]
use crate::memory;
#[cfg(not(target_arch = "wasm32"))]
use crate::process::PerProcess;
#[cfg(not(target_arch = "wasm32"))]
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::atomic::{AtomicUsize, Ordering};
#[cfg(not(target_arch = "wasm32"))]
use std::sync::{Arc, Mutex, PoisonError};

#[cfg_attr(target_arch = "wasm32", path = "threads/prelude_in_browser.rs")]
pub(crate) mod prelude;

/// The largest number of threads: more than any match can use, and few enough for every system.
pub(crate) const MOST: usize = 1024;

/// Bytes of a thread's stack.
#[cfg(not(target_arch = "wasm32"))]
const STACK: u64 = 2 << 20;

/// Most threads per processor: more would only wait for each other.
#[cfg(not(target_arch = "wasm32"))]
const PER_PROCESSOR: usize = 4;

/// Least pixels per thread: with fewer, distributing the work takes longer than doing it. [`FEW`] threads are always allowed.
#[cfg(not(target_arch = "wasm32"))]
const PIXELS: usize = 1024;
#[cfg(not(target_arch = "wasm32"))]
const FEW: usize = 8;

/// Environment variables that limit the threads: conventions of other programs, and Slurm's grants.
const VARIABLES: [&str; 4] =
    ["RAYON_NUM_THREADS", "OMP_NUM_THREADS", "SLURM_CPUS_PER_TASK", "SLURM_CPUS_ON_NODE"];

/// The processors that this process may use, with affinity and cgroup quotas.
fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// The default number of threads: the processors that this process may use, or less where
/// `RAYON_NUM_THREADS`, `OMP_NUM_THREADS`, `SLURM_CPUS_PER_TASK` or `SLURM_CPUS_ON_NODE` is a smaller number.
#[must_use]
pub fn usual() -> usize {
    usual_of(processors(), |name| std::env::var(name).ok())
}

fn usual_of(processors: usize, variable: impl Fn(&str) -> Option<String>) -> usize {
    let number = |name: &&str| {
        let text = variable(name)?;
        // OpenMP takes a list with one number for each nesting level.
        let first = text.split(',').next()?;
        first.trim().parse().ok().filter(|count| *count > 0)
    };
    VARIABLES.iter().filter_map(number).fold(processors, usize::min).max(1)
}

/// Refuses a number of threads outside 1 to [`MOST`].
fn check(count: Option<usize>) -> Result<()> {
    match count.filter(|count| !(1..=MOST).contains(count)) {
        Some(wanted) => Err(ExecutionError::ThreadCount { wanted, most: MOST }.into()),
        None => Ok(()),
    }
}

/// A thread pool for one purpose, started when it is first needed. A browser has a single thread.
#[derive(Debug)]
pub(crate) struct Threads {
    /// The requested number of threads; 0 for the default.
    wanted: AtomicUsize,
    #[cfg(not(target_arch = "wasm32"))]
    kept: PerProcess<Mutex<Option<Kept>>>,
}

#[cfg(not(target_arch = "wasm32"))]
#[derive(Debug)]
struct Kept {
    processors: usize,
    usual: usize,
    pool: Arc<ThreadPool>,
}

impl Threads {
    const fn usual() -> Self {
        Self {
            wanted: AtomicUsize::new(0),
            #[cfg(not(target_arch = "wasm32"))]
            kept: PerProcess::new(),
        }
    }

    /// At most `count` threads, or the [default](usual) number.
    ///
    /// # Errors
    /// [`ExecutionError`] for 0 and for more than [`MOST`]; [`MemoryError`](crate::error::MemoryError) if
    /// their stacks do not fit.
    #[cfg_attr(target_arch = "wasm32", expect(clippy::needless_update, reason = "a browser has no pool"))]
    pub(crate) fn new(count: Option<usize>) -> Result<Self> {
        check(count)?;
        #[cfg(not(target_arch = "wasm32"))]
        memory::check(count.unwrap_or(1) as u64 * STACK, Purpose::Match)?;
        Ok(Self { wanted: AtomicUsize::new(count.unwrap_or(0)), ..Self::usual() })
    }
}

#[cfg(not(target_arch = "wasm32"))]
impl Threads {
    /// The pool for work on `pixels` pixels.
    ///
    /// # Errors
    /// [`ExecutionError`] if the system does not start them.
    pub(crate) fn pool(&self, pixels: usize) -> Result<Arc<ThreadPool>> {
        let mut kept = self.kept.get().lock().unwrap_or_else(PoisonError::into_inner);
        let (processors, usual) =
            kept.as_ref().map_or_else(|| (processors(), usual()), |kept| (kept.processors, kept.usual));
        let most = match self.wanted.load(Ordering::Relaxed) {
            0 => usual,
            wanted => wanted.min(PER_PROCESSOR * processors),
        };
        let count = most.min(FEW.max(pixels / PIXELS));
        if let Some(kept) = kept.as_ref().filter(|kept| kept.pool.current_num_threads() == count) {
            return Ok(Arc::clone(&kept.pool));
        }
        // The old threads end when their last user drops them.
        let pool = ThreadPoolBuilder::new().num_threads(count).stack_size(STACK as usize).build();
        let pool = Arc::new(pool.map_err(|e| ExecutionError::Threads(e.to_string()))?);
        // A thread takes memory when it starts. Start all of them before anything measures the free memory.
        pool.broadcast(|_| ());
        *kept = Some(Kept { processors, usual, pool: Arc::clone(&pool) });
        Ok(pool)
    }

    /// Runs `work` on `pixels` pixels in the pool, and blocks until it is done.
    ///
    /// # Errors
    /// [`ExecutionError`] if the system does not start the threads.
    #[allow(clippy::unused_async, reason = "it has something to await in a browser")]
    pub(crate) async fn run<T: Send>(
        &self,
        pixels: usize,
        work: impl AsyncFnOnce() -> T + Send,
    ) -> Result<T> {
        Ok(self.pool(pixels)?.install(|| pollster::block_on(work())))
    }
}

#[cfg(target_arch = "wasm32")]
impl Threads {
    pub(crate) async fn run<T>(&self, _: usize, work: impl AsyncFnOnce() -> T) -> Result<T> {
        Ok(work().await)
    }
}

/// The threads outside matchers.
static SHARED: Threads = Threads::usual();

/// Limits the threads outside matchers to `count`; 0 stands for the [default](usual) number.
pub fn limit(count: usize) {
    SHARED.wanted.store(count, Ordering::Relaxed);
}

/// Runs `work` in the `rayon` pool from which this is called, or else in the pool of the process.
pub fn run<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    #[cfg(not(target_arch = "wasm32"))]
    if rayon::current_thread_index().is_none() {
        match SHARED.pool(usize::MAX) {
            Ok(pool) => return pool.install(work),
            // Run it on this thread alone.
            Err(_) => drop(ThreadPoolBuilder::new().num_threads(1).use_current_thread().build()),
        }
    }
    work()
}

/// The number of threads of [`run`].
#[must_use]
pub fn count() -> usize {
    run(prelude::current_num_threads)
}

/// Runs both, in parallel if there are threads.
pub fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    run(|| prelude::join(a, b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;

    #[test]
    fn impossible_numbers_of_threads_are_refused() {
        for wanted in [0, 1025, usize::MAX] {
            let Err(Error::Execution(error)) = Threads::new(Some(wanted)) else { panic!("{wanted}") };
            assert_eq!(error, ExecutionError::ThreadCount { wanted, most: 1024 });
        }
        assert!(Threads::new(Some(1)).is_ok() && Threads::new(None).is_ok());
    }

    #[test]
    fn environment_variables_lower_the_default() {
        for (variables, expected) in [
            (&[][..], 8),
            (&[("OMP_NUM_THREADS", "3")], 3),
            (&[("OMP_NUM_THREADS", " 4,2 ")], 4),
            (&[("RAYON_NUM_THREADS", "2")], 2),
            (&[("SLURM_CPUS_PER_TASK", "1")], 1),
            (&[("SLURM_CPUS_ON_NODE", "1")], 1),
            // The smallest of all variables.
            (&[("SLURM_CPUS_ON_NODE", "6"), ("SLURM_CPUS_PER_TASK", "4"), ("OMP_NUM_THREADS", "5")], 4),
            // Values that are no positive number are ignored, and no value exceeds the number of processors.
            (&[("OMP_NUM_THREADS", "0")], 8),
            (&[("OMP_NUM_THREADS", ""), ("RAYON_NUM_THREADS", "many"), ("SLURM_CPUS_PER_TASK", "-1")], 8),
            (&[("OMP_NUM_THREADS", "64")], 8),
            (&[("MKL_NUM_THREADS", "1")], 8),
        ] {
            let variable = |name: &str| {
                variables.iter().find(|(known, _)| *known == name).map(|(_, text)| (*text).to_owned())
            };
            assert_eq!(usual_of(8, variable), expected, "{variables:?}");
        }
        assert_eq!(usual_of(0, |_| None), 1);
    }

    #[test]
    fn small_work_gets_few_threads() {
        let (many, one) = (Threads::new(Some(MOST)).unwrap(), Threads::new(Some(1)).unwrap());
        let count = |threads: &Threads, pixels: usize| threads.pool(pixels).unwrap().current_num_threads();
        let most = PER_PROCESSOR * processors();
        for (pixels, expected) in [(0, FEW), (9 * PIXELS, 9), (usize::MAX, most), (9 * PIXELS, 9)] {
            assert_eq!(count(&many, pixels), expected.min(most), "{pixels} pixels");
            assert_eq!(count(&one, pixels), 1);
        }
        // The pool is kept while its size fits.
        assert!(Arc::ptr_eq(&many.pool(0).unwrap(), &many.pool(PIXELS).unwrap()));
    }
}
