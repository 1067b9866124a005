//! Limits costs to the label ranges of the pixels: see [`crate::backend::Stage::LabelRange`].

use crate::backend::cpu::units::Units;
use crate::backend::cpu::volumes::Volumes;
use crate::image::Plane;
use crate::plan::{COST_FRACTION_BITS, COST_MAX, LevelPlan};
use crate::threads::prelude::*;

pub(super) fn run<U: Units>(v: &mut Volumes<U>, level: usize) {
    let (plan, ranges) = (&v.plan.levels[level], &v.label_ranges[level]);
    if level == 0 {
        limit(plan, ranges, &mut v.fine_cost, COST_MAX);
    } else {
        limit(plan, ranges, &mut v.levels[level].cost, u16::from(COST_MAX) << COST_FRACTION_BITS);
    }
}

fn limit<C: Copy + Send + Sync>(
    level: &LevelPlan,
    label_range: &Plane<[u16; 2]>,
    cost: &mut [C],
    highest: C,
) {
    let pixels = cost.par_chunks_exact_mut(level.stride).zip(label_range.data());
    pixels.for_each(|(cost, &[first, last])| {
        cost[..usize::from(first)].fill(highest);
        cost[usize::from(last) + 1..level.labels].fill(highest);
    });
}
