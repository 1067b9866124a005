//! Steps of the paper before a match: corrects the illumination, and limits labels by texture zones.

use super::illumination::homomorphic;
use super::prepared::Prepared;
use super::{label_range, matches, zones};
use crate::error::Result;
use crate::image::Pair;
use crate::options::Illumination;
use crate::plan::Plan;
use crate::watch::Watch;

/// Prepares a match of `pair` by `plan`, which is of its size, as far as the method asks for it.
pub(super) fn prepare(pair: &Pair, plan: &Plan, watch: &mut Watch) -> Result<Prepared> {
    let method = &plan.method;
    if method.front.corrects_illumination() || plan.limits_labels() {
        pair.compute();
    }
    let corrected = if method.front.corrects_illumination() {
        let both = || {
            let corrected = Pair::new(homomorphic(pair.left()), homomorphic(pair.right()))?;
            Ok(corrected.with_full(pair.full().cloned()))
        };
        Some(watch.host("illumination", both)?)
    } else {
        None
    };
    let matched = corrected.as_ref().unwrap_or(pair);
    let mut prepared = Prepared::new(matched);
    if plan.limits_labels() {
        let first = method.front.illumination == Illumination::HomomorphicFirst;
        let pair = if first { matched } else { pair };
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
