use super::change::labels;
use super::{Finest, most};
use mrfgs::image::Plane;
use mrfgs::low_level::plan::Plan;

/// The optimum of every pixel, and its runner-up.
pub fn winner_takes_all(plan: &Plan, belief: &[u32], maps: &mut Finest) {
    let level = &plan.levels[0];
    let (width, height, count) = (level.width, level.height, level.labels as i64);
    let optima = labels(belief, level.labels);
    let smallest_of = |x: usize, y: usize, wanted: &dyn Fn(i64) -> bool| {
        let row = &belief[(y * width + x) * level.labels..];
        let values = (0..count).filter(|&d| wanted(d - optima[y * width + x])).map(|d| row[d as usize]);
        let values = values.filter(|&b| b < most(plan));
        values.min().map_or(65_535, |v| v as i32)
    };
    maps.label = Plane::from_fn(width, height, |x, y| optima[y * width + x] as i32);
    maps.best = Plane::from_fn(width, height, |x, y| smallest_of(x, y, &|step| step == 0));
    maps.runner_up = Plane::from_fn(width, height, |x, y| smallest_of(x, y, &|step| step.abs() > 1));
}
