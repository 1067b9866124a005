//! From a pair to its maps in one call.

use crate::backend::Backend;
use crate::backend::cpu::Cpu;
use crate::error::{Error, Result};
use crate::image::Pair;
use crate::options::{DisparityRange, Execution, Method};
use crate::plan::Plan;
use crate::solver::{self, Observer, Solution};

/// The maps of a pair, and what made them.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Matched {
    /// The maps.
    pub solution: Solution,
    /// The plan that was followed.
    pub plan: Plan,
    /// What ran the stages, for people.
    pub ran_on: String,
    /// Why it is not the device that was hoped for, where that is so.
    pub note: Option<String>,
}

/// Matches `pair` over `range` by `method`, where `execution` says; `observer` hears of progress and can stop it.
///
/// # Errors
/// [`Error::Option`] for options out of range, [`Error::Device`] where the wanted device is missing or fails,
/// [`Error::Interrupted`] when `observer` breaks.
pub fn match_pair(
    pair: &Pair,
    range: DisparityRange,
    method: &Method,
    execution: &Execution,
    observer: Observer,
) -> Result<Matched> {
    let (width, height) = pair.size();
    let plan = Plan::new(width, height, range, method)?;
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = execution.threads {
        pool = pool.num_threads(threads);
    }
    let pool = pool.build().map_err(|e| Error::option("--threads", e.to_string()))?;
    let (solution, ran_on) = pool.install(|| {
        let mut cpu = Cpu::default();
        solver::solve(&mut cpu, &plan, pair, observer).map(|solution| (solution, cpu.describe()))
    })?;
    Ok(Matched { solution, plan, ran_on, note: None })
}
