//! Costs within the pixels' label range alone: see [`crate::backend::Stage::LabelRange`].

use crate::image::Plane;
use crate::plan::LevelPlan;
use rayon::prelude::*;

pub(super) fn run<C: Copy + Send + Sync>(
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
