//! From a pair to its maps in one call.

use crate::backend::Backend;
use crate::backend::cpu::Cpu;
use crate::backend::gpu::{self, Gpu};
use crate::error::{Error, Result};
use crate::image::Pair;
use crate::options::{Choice, DisparityRange, Execution, Method};
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
/// [`Error::Memory`] when the machine or the device cannot hold it, [`Error::Interrupted`] when `observer` breaks.
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
    pool.install(|| match execution.backend {
        Choice::Cpu if execution.device.is_some() => Err(Error::option(
            "--device",
            "names a device, and --backend cpu uses none: leave one of them out",
        )),
        Choice::Cpu => run(&mut Cpu::default(), plan, pair, observer, None),
        Choice::Gpu => run(&mut Gpu::new(execution.device.as_deref())?, plan, pair, observer, None),
        // Who names a device means it.
        Choice::Auto if execution.device.is_some() => {
            run(&mut Gpu::new(execution.device.as_deref())?, plan, pair, observer, None)
        }
        Choice::Auto if !gpu::has_automatic() => run(&mut Cpu::default(), plan, pair, observer, None),
        Choice::Auto => {
            let tried =
                Gpu::new(None).and_then(|mut gpu| run(&mut gpu, plan.clone(), pair, &mut *observer, None));
            match tried {
                // The bits are the same on the CPU path, so a device that fails costs time and nothing else.
                Err(e @ (Error::Device(_) | Error::Memory(_))) => {
                    run(&mut Cpu::default(), plan, pair, observer, Some(e.to_string()))
                }
                other => other,
            }
        }
    })
}

fn run(
    backend: &mut dyn Backend,
    plan: Plan,
    pair: &Pair,
    observer: Observer,
    note: Option<String>,
) -> Result<Matched> {
    let solution = solver::solve(backend, &plan, pair, observer)?;
    Ok(Matched { solution, plan, ran_on: backend.describe(), note })
}
