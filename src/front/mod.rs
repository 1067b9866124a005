//! The front end (section 2.4): everything that a match derives from the images alone, before any cost is
//! computed.

pub(crate) mod conditioning;
#[cfg(feature = "cameras")]
pub mod drift;
#[cfg(feature = "cameras")]
mod exchanged;
mod filter;
#[cfg(feature = "paper")]
pub(crate) mod illumination;
#[cfg(feature = "paper")]
pub mod label_range;
pub mod matches;
#[cfg(all(feature = "files", not(target_arch = "wasm32")))]
mod overview;
#[cfg(feature = "paper")]
mod paper;
mod parts;
mod prepared;
pub(crate) mod prior;
mod range;
#[cfg(feature = "cameras")]
mod unrectified;
mod warnings;
#[cfg(feature = "paper")]
pub mod zones;

pub use prepared::Prepared;

/// Warns of likely faults of a pair, and finds its disparity range.
pub mod check {
    #[cfg(all(feature = "files", not(target_arch = "wasm32")))]
    pub use super::overview::{overview, range_of_overview, warnings_of_overview};
    pub use super::parts::Part;
    pub use super::range::{beyond, goes_beyond, range, range_of_cameras, wider};
    pub use super::warnings::{Warning, damaged, warnings, warnings_of, warnings_of_match};
}

use crate::error::{Error, Purpose, Result};
use crate::image::Pair;
use crate::memory;
use crate::options::{DisparityRange, Method};
use crate::plan::Plan;
use crate::watch::{Followed, Progress, Watch};
use conditioning::Conditioning;
use std::ops::ControlFlow;

/// `pair` at the size at which `plan` matches it; a half is computed at once, or on first use.
fn at_size(pair: &Pair, plan: &Plan, at_once: bool, watch: &mut Watch) -> Result<Pair> {
    memory::check(plan.halving_bytes() + 3 * plan.conditioning_bytes(), Purpose::Match)?;
    let half = || Ok(if at_once { pair.halved() } else { pair.halved_on_use() });
    if plan.full.is_some() { watch.host("half_size", half) } else { Ok(pair.clone()) }
}

/// The pair that is matched by `plan` in the place of `pair`, and what was corrected in that. Where the pair is matched at half its
/// size, its faults are measured there.
///
/// # Errors
/// [`Error::Memory`] when the machine cannot hold it, and [`Error::Interrupted`] when the observer breaks.
pub(crate) fn condition(pair: &Pair, plan: &Plan, watch: &mut Watch) -> Result<(Pair, Conditioning)> {
    let pair = at_size(pair, plan, true, watch)?;
    if plan.conditioning_bytes() == 0 {
        return Ok((pair, Conditioning::default()));
    }
    watch.host("conditioning", || {
        let (conditioned, found) = conditioning::condition(&pair, plan.range, &plan.method.front);
        let Some(full) = pair.full().filter(|_| found != Conditioning::default()) else {
            return Ok((conditioned, found));
        };
        let found = found.doubled();
        Ok((conditioned.with_full(Some(found.apply(full))), found))
    })
}

impl Conditioning {
    /// The corrections that a match of `pair` over the disparities of `range` by `method` measures.
    ///
    /// # Errors
    /// [`Error::Option`] for options out of range, and [`Error::Memory`] when the machine cannot hold it.
    pub fn measured(pair: &Pair, range: DisparityRange, method: &Method) -> Result<Self> {
        let (width, height) = pair.size();
        let plan = Plan::new(width, height, range, method)?;
        let quiet = &mut |_: Progress| ControlFlow::Continue(());
        Ok(condition(pair, &plan, &mut Watch::new(quiet, Followed::default()))?.1)
    }
}

/// Like [`condition`], with corrections that are known, for `pair` at its own size. If the backend `halves` pairs, the host
/// leaves that to it where nothing is corrected.
///
/// # Errors
/// The errors of [`condition`].
pub(crate) fn correct(
    pair: &Pair,
    plan: &Plan,
    known: &Conditioning,
    halves: bool,
    watch: &mut Watch,
) -> Result<Pair> {
    let at_once = !halves || *known != Conditioning::default();
    let pair = at_size(pair, plan, at_once, watch)?;
    if *known == Conditioning::default() {
        return Ok(pair);
    }
    watch.host("conditioning", || {
        let Some(full) = pair.full() else { return Ok(known.apply(&pair)) };
        Ok(known.halved().apply(&pair).with_full(Some(known.apply(full))))
    })
}

/// `pair` as it is matched, after `conditioning`, at twice its size: a disparity there is twice what it is here.
///
/// # Errors
/// [`Error::Memory`] when the machine cannot hold it.
pub(crate) fn doubled(pair: &Pair, conditioning: &Conditioning) -> Result<Pair> {
    let (width, height) = pair.size();
    // A pixel of the conditioned pair, of the pair at twice its size, and what the filters of one view work on.
    memory::check((18 + 2 * 36 + 84) * (width * height) as u64, Purpose::Match)?;
    Ok(conditioning.apply(pair).map(filter::doubled))
}

/// Prepares a match of `pair` by `plan`.
///
/// # Errors
/// [`Error::Mismatch`] when the plan is for another size, [`Error::Memory`] when the machine cannot hold it, and
/// [`Error::Interrupted`] when the observer breaks.
#[cfg_attr(not(feature = "paper"), expect(unused_variables, reason = "nothing takes long"))]
pub fn prepare(pair: Pair, plan: &Plan, watch: &mut Watch) -> Result<Prepared> {
    if plan.size() != pair.size() {
        let (plan, pair) = (plan.size(), pair.size());
        return Err(Error::Mismatch(format!("a plan for {plan:?} and a pair of {pair:?}")));
    }
    memory::check(plan.front_bytes(), Purpose::Match)?;
    #[cfg(feature = "paper")]
    {
        paper::prepare(&pair, plan, watch)
    }
    #[cfg(not(feature = "paper"))]
    {
        Ok(Prepared::new(&pair))
    }
}
