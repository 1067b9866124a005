//! The lead of each pixel's label: see [`crate::backend::Stage::Confidence`].

use crate::image::Pair;
use crate::maps::flag;
use crate::plan::Plan;
use crate::stage::MapSet;
use crate::threads::prelude::*;

/// Minimum number of pixels per thread.
const LEAST: usize = 1 << 14;

pub(super) fn run(maps: &mut MapSet, _: &Plan, _: &Pair) {
    let MapSet { optima, validity, confidence, .. } = maps;
    let pixels = confidence.data_mut().par_iter_mut().zip(validity.data()).zip(optima.data());
    pixels.with_min_len(LEAST).for_each(|((confidence, flags), optimum)| {
        let lead = (2 * u32::from(optimum.runner_up - optimum.best)).min(255);
        *confidence = if flags & flag::INVALID == 0 { lead as u8 } else { 0 };
    });
}
