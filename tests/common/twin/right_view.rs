use super::{Finest, most};
use mrfgs::image::{Image, Plane};
use mrfgs::low_level::backend::NO_LABEL;
use mrfgs::low_level::plan::Plan;

/// The label map of the right view. `left` is the left image.
pub fn right_view(plan: &Plan, left: &Image, belief: &[u32], maps: &mut Finest) {
    let level = &plan.levels[0];
    let (width, height, count) = (level.width, level.height, level.labels as i64);
    let at = |x: usize, y: usize, d: i64| belief[(y * width + x) * level.labels + d as usize];
    let seen = Plane::from_fn(width, height, |x, y| {
        let mut smallest = None;
        for d in 0..count {
            let xl = x as i64 + i64::from(level.min) + d;
            if xl >= plan.core.start as i64 && xl < plan.core.end as i64 && !left.masked[(xl as usize, y)] {
                let b = at(xl as usize, y, d);
                if b < most(plan) && smallest.is_none_or(|(_, least)| b < least) {
                    smallest = Some((d as i32, b));
                }
            }
        }
        smallest
    });
    maps.right_label = seen.map(|s| s.map_or(NO_LABEL.into(), |(label, _)| label));
    maps.right_best = seen.map(|s| s.map_or(65_535, |(_, best)| best as i32));
}
