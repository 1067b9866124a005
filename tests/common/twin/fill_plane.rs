use super::Finest;
use super::median::{Window, filled, smooth};
use super::plane::through;
use mrfgs::image::Pair;
use mrfgs::low_level::plan::Plan;

/// Planes, or medians, over the surroundings of filled pixels: first far in all directions, then along rows.
pub fn fill_plane(plan: &Plan, pair: &Pair, maps: &mut Finest) {
    let sigma_range = plan.method.refinement.median_sigma_range / 3.0;
    for step in [(8, 8), (16, 1)] {
        let window = Window { radius: 6, step, checkered: false, sigma_space: 4.3, sigma_range };
        if plan.method.refinement.plane {
            through(plan, pair, maps, &window, filled);
        } else {
            smooth(plan, pair, maps, &window, 1, filled);
        }
    }
}
