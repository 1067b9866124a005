//! Threads: how many there are where nobody says it, and those that work beside matchers.
//!
//! A matcher has threads of its own. All else that is shared among threads (reading, rectification, checks) is done by threads that all of
//! the process has together, or by those of the `rayon` pool that it is called from. A process that is forked has its own.

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

/// The largest number of threads: more than any match can share, and few enough for every system.
pub(crate) const MOST: usize = 1024;

/// Bytes of a thread's stack.
#[cfg(not(target_arch = "wasm32"))]
const STACK: u64 = 2 << 20;

/// Threads for each processor, at most: more of them only wait for each other, longer and longer.
#[cfg(not(target_arch = "wasm32"))]
const PER_PROCESSOR: usize = 4;

/// Pixels for each thread, at least: with fewer it takes longer to hand out the work than to do it. A few threads do no harm.
#[cfg(not(target_arch = "wasm32"))]
const PIXELS: usize = 1024;
#[cfg(not(target_arch = "wasm32"))]
const FEW: usize = 8;

/// What may hold fewer threads than the machine has processors: what other programs go by, and what Slurm grants to a task.
const VARIABLES: [&str; 4] =
    ["RAYON_NUM_THREADS", "OMP_NUM_THREADS", "SLURM_CPUS_PER_TASK", "SLURM_CPUS_ON_NODE"];

/// The processors that the system lets this process use: affinity and the quotas of cgroups count.
fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// How many threads there are where nobody says it: as many as processors that the system lets this process use, or fewer where
/// `RAYON_NUM_THREADS`, `OMP_NUM_THREADS`, `SLURM_CPUS_PER_TASK` or `SLURM_CPUS_ON_NODE` is a smaller number.
#[must_use]
pub fn usual() -> usize {
    usual_of(processors(), |name| std::env::var(name).ok())
}

fn usual_of(processors: usize, variable: impl Fn(&str) -> Option<String>) -> usize {
    let number = |name: &&str| {
        let text = variable(name)?;
        // OpenMP has one for each level of threads that begin others.
        let first = text.split(',').next()?;
        first.trim().parse().ok().filter(|count| *count > 0)
    };
    VARIABLES.iter().filter_map(number).fold(processors, usize::min).max(1)
}

/// Refuses numbers of threads that there may not be.
fn check(count: Option<usize>) -> Result<()> {
    match count.filter(|count| !(1..=MOST).contains(count)) {
        Some(wanted) => Err(ExecutionError::ThreadCount { wanted, most: MOST }.into()),
        None => Ok(()),
    }
}

/// Threads for one purpose, which begin when they are needed. A browser has one alone.
#[derive(Debug)]
pub(crate) struct Threads {
    /// How many are wanted; 0 for the usual number.
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

    /// So many threads at most, or the [usual](usual) number.
    ///
    /// # Errors
    /// [`ExecutionError`] for none at all, and for more than [`MOST`]; [`MemoryError`](crate::error::MemoryError) where their stacks do
    /// not fit.
    pub(crate) fn new(count: Option<usize>) -> Result<Self> {
        check(count)?;
        #[cfg(not(target_arch = "wasm32"))]
        memory::check(count.unwrap_or(1) as u64 * STACK, Purpose::Match)?;
        Ok(Self { wanted: AtomicUsize::new(count.unwrap_or(0)), ..Self::usual() })
    }
}

#[cfg(not(target_arch = "wasm32"))]
impl Threads {
    /// The threads for work on so many pixels.
    ///
    /// # Errors
    /// [`ExecutionError`] where the system does not start them.
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
        // Those before end when nobody uses them any more.
        let pool = ThreadPoolBuilder::new().num_threads(count).stack_size(STACK as usize).build();
        let pool = Arc::new(pool.map_err(|e| ExecutionError::Threads(e.to_string()))?);
        // A thread takes memory when it begins. All have begun before anybody counts what is left.
        pool.broadcast(|_| ());
        *kept = Some(Kept { processors, usual, pool: Arc::clone(&pool) });
        Ok(pool)
    }

    /// Does `work` on so many pixels there. Who awaits this waits for it.
    ///
    /// # Errors
    /// [`ExecutionError`] where the system does not start the threads.
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

/// Those of no matcher.
static SHARED: Threads = Threads::usual();

/// No more than `count` threads work beside matchers from now on; 0 stands for the [usual](usual) number.
pub fn limit(count: usize) {
    SHARED.wanted.store(count, Ordering::Relaxed);
}

/// Does `work` where it can be shared among threads: those of the pool of `rayon` that this is called from, or else those that all of the
/// process has together.
pub fn run<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    #[cfg(not(target_arch = "wasm32"))]
    if rayon::current_thread_index().is_none() {
        match SHARED.pool(usize::MAX) {
            Ok(pool) => return pool.install(work),
            // This thread does it by itself.
            Err(_) => drop(ThreadPoolBuilder::new().num_threads(1).use_current_thread().build()),
        }
    }
    work()
}

/// How many threads there are for [`run`].
#[must_use]
pub fn count() -> usize {
    run(prelude::current_num_threads)
}

/// Does both, at the same time where there are threads for it.
pub fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    run(|| prelude::join(a, b))
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

    #[test]
    fn the_environment_says_how_many_are_usual() {
        for (variables, expected) in [
            (&[][..], 8),
            (&[("OMP_NUM_THREADS", "3")], 3),
            (&[("OMP_NUM_THREADS", " 4,2 ")], 4),
            (&[("RAYON_NUM_THREADS", "2")], 2),
            (&[("SLURM_CPUS_PER_TASK", "1")], 1),
            (&[("SLURM_CPUS_ON_NODE", "1")], 1),
            // The smallest of all.
            (&[("SLURM_CPUS_ON_NODE", "6"), ("SLURM_CPUS_PER_TASK", "4"), ("OMP_NUM_THREADS", "5")], 4),
            // What is no number of threads says nothing, and none gives more than there are processors.
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
    fn there_are_no_more_than_the_work_takes() {
        let (many, one) = (Threads::new(Some(MOST)).unwrap(), Threads::new(Some(1)).unwrap());
        let count = |threads: &Threads, pixels: usize| threads.pool(pixels).unwrap().current_num_threads();
        let most = PER_PROCESSOR * processors();
        for (pixels, expected) in [(0, FEW), (9 * PIXELS, 9), (usize::MAX, most), (9 * PIXELS, 9)] {
            assert_eq!(count(&many, pixels), expected.min(most), "{pixels} pixels");
            assert_eq!(count(&one, pixels), 1);
        }
        // The same as long as they suffice.
        assert!(Arc::ptr_eq(&many.pool(0).unwrap(), &many.pool(PIXELS).unwrap()));
    }
}
