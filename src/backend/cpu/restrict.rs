//! Costs within the pixels' support alone: see [`crate::backend::Stage::Restrict`].

use crate::image::Plane;
use crate::plan::LevelPlan;
use rayon::prelude::*;

pub(super) fn run<C: Copy + Send + Sync>(
    level: &LevelPlan,
    support: &Plane<[u16; 2]>,
    cost: &mut [C],
    highest: C,
) {
    let pixels = cost.par_chunks_exact_mut(level.stride).zip(support.data());
    pixels.for_each(|(cost, &[first, last])| {
        cost[..usize::from(first)].fill(highest);
        cost[usize::from(last) + 1..level.labels].fill(highest);
    });
}
