//! Planes through the disparities, from the median on: see [`crate::backend::Stage::Plane`].

use super::median::{smooth, touched};
use crate::image::Pair;
use crate::maps::FRACTION;
use crate::plan::Plan;
use crate::stage::MapSet;
use crate::weights::MedianWeights;

pub(super) fn run(maps: &mut MapSet, plan: &Plan, pair: &Pair) {
    let guide = pair.left();
    smooth(&MedianWeights::of_planes(&plan.method), touched(plan), Some(limits(plan)), guide, maps);
}

/// The limits of the values of planes.
pub(super) fn limits(plan: &Plan) -> (i32, i32) {
    (plan.range.min * FRACTION, plan.range.max * FRACTION)
}
