//! Planes through the disparities, from the median on: see [`crate::backend::Stage::Plane`].

use super::finest::Finest;
use super::median::{smooth, touched};
use crate::image::Image;
use crate::maps::FRACTION;
use crate::plan::Plan;
use crate::weights::MedianWeights;

pub(super) fn run(maps: &mut Finest, plan: &Plan, guide: &Image) {
    let limits = (plan.range.min * FRACTION, plan.range.max * FRACTION);
    smooth(&MedianWeights::of(&plan.method), touched(plan), Some(limits), guide, maps);
}
