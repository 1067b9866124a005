//! The stretched median of the filled pixels: see [`crate::backend::Stage::FillMedian`].

use super::finest::Finest;
use super::median::smooth;
use crate::image::Image;
use crate::maps::flag;
use crate::plan::Plan;
use crate::weights::MedianWeights;

pub(super) fn run(maps: &mut Finest, plan: &Plan, guide: &Image) {
    smooth(&MedianWeights::stretched(&plan.method), |f| f & flag::FILLED != 0, None, guide, maps);
}
