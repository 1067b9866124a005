//! The front end (section 2.4): everything that a match derives from the images alone, before any cost is
//! computed.

pub mod check;
pub mod conditioning;
pub mod drift;
mod exchanged;
mod filter;
pub mod illumination;
pub mod label_range;
pub mod matches;
mod parts;
mod unrectified;
pub mod zones;

use crate::error::{Error, Purpose, Result};
use crate::image::{Pair, Plane};
use crate::memory;
use crate::options::Illumination;
use crate::plan::Plan;
use crate::watch::Watch;
use conditioning::Conditioning;
use illumination::homomorphic;
use matches::SparseMatch;
use zones::Zones;

/// Everything that a backend needs for a match.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// The pair to match, its illumination corrected where the method asks for it.
    pub pair: Pair,
    /// First and last label index of each pixel, by level; empty where every label is allowed.
    pub label_ranges: Vec<Plane<[u16; 2]>>,
    /// The source of the label ranges: texture zones and sparse matches.
    pub zones: Option<(Zones, Vec<SparseMatch>)>,
}

impl Prepared {
    /// A pair that is matched as it is, with all labels.
    #[must_use]
    pub fn new(pair: &Pair) -> Self {
        Self { pair: pair.clone(), label_ranges: Vec::new(), zones: None }
    }
}

/// The pair that is matched by `plan` in the place of `pair`, and what was corrected in that. Where the pair is matched at half its
/// size, its faults are measured there.
///
/// # Errors
/// [`Error::Memory`] when the machine cannot hold it, and [`Error::Interrupted`] when the observer breaks.
pub fn condition(pair: &Pair, plan: &Plan, watch: &mut Watch) -> Result<(Pair, Conditioning)> {
    memory::check(plan.halving_bytes() + 3 * plan.conditioning_bytes(), Purpose::Match)?;
    let halved = plan.full.is_some();
    let pair = if halved { watch.host("half_size", || Ok(pair.halved()))? } else { pair.clone() };
    if plan.conditioning_bytes() == 0 {
        return Ok((pair, Conditioning::default()));
    }
    watch.host("conditioning", || {
        let (conditioned, found) = conditioning::condition(&pair, plan.range, &plan.method.front);
        let Some(full) = pair.full() else { return Ok((conditioned, found)) };
        let found = found.doubled();
        Ok((conditioned.with_full(Some(found.apply(full))), found))
    })
}

/// `pair` as it is matched, after `conditioning`, at twice its size: a disparity there is twice what it is here.
///
/// # Errors
/// [`Error::Memory`] when the machine cannot hold it.
pub fn doubled(pair: &Pair, conditioning: &Conditioning) -> Result<Pair> {
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
pub fn prepare(pair: Pair, plan: &Plan, watch: &mut Watch) -> Result<Prepared> {
    if plan.size() != pair.size() {
        let (plan, pair) = (plan.size(), pair.size());
        return Err(Error::Mismatch(format!("a plan for {plan:?} and a pair of {pair:?}")));
    }
    memory::check(plan.front_bytes(), Purpose::Match)?;
    let method = &plan.method;
    let illumination = method.front.illumination;
    let corrected = match illumination {
        Illumination::None => None,
        Illumination::Homomorphic | Illumination::HomomorphicFirst => {
            let both = || {
                let corrected = Pair::new(homomorphic(pair.left()), homomorphic(pair.right()))?;
                Ok(corrected.with_full(pair.full().cloned()))
            };
            Some(watch.host("illumination", both)?)
        }
    };
    let matched = corrected.as_ref().unwrap_or(&pair);
    let mut prepared = Prepared::new(matched);
    if plan.limits_labels() {
        let pair = if illumination == Illumination::HomomorphicFirst { matched } else { &pair };
        let options = zones::Options {
            clusters: method.front.clusters as usize,
            extent: method.front.zone_extent,
            ..zones::Options::default()
        };
        let zones = watch.host("zones", || Ok(zones::segment(pair.left(), &options)))?;
        matches::check_memory(pair)?;
        let split = Some((&zones.map, zones.count));
        let matches = watch.host("matches", || Ok(matches::find(pair, split, Some(plan.range))))?;
        prepared.label_ranges =
            watch.host("label_range", || Ok(label_range::levels(plan, &zones, &matches)))?;
        prepared.zones = Some((zones, matches));
    }
    Ok(prepared)
}
