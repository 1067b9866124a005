//! Planes through the disparities of filled pixels: see [`crate::backend::Stage::FillPlane`].

use super::median::smooth;
use super::plane::limits;
use crate::image::Pair;
use crate::maps::is_filled;
use crate::plan::Plan;
use crate::stage::MapSet;
use crate::weights::{FILL_STEP_BITS, MedianWeights};

pub(super) fn run(maps: &mut MapSet, plan: &Plan, pair: &Pair) {
    let guide = pair.left();
    let limits = plan.method.refinement.plane.then(|| limits(plan));
    for step_bits in FILL_STEP_BITS {
        let weights = MedianWeights::of_filled(&plan.method, step_bits);
        smooth(&weights, is_filled, limits, guide, maps);
    }
}
