use super::Finest;
use super::median::{filled, smooth};
use super::plane::through;
use mrfgs::image::Pair;
use mrfgs::low_level::plan::Plan;

/// Planes through what is around filled pixels, or medians of it: first far in all directions, then along rows.
pub fn fill_plane(plan: &Plan, pair: &Pair, maps: &mut Finest) {
    let sigma_range = plan.method.refinement.median_sigma_range / 3.0;
    for step in [(4, 4), (8, 1)] {
        if plan.method.refinement.plane {
            through(plan, pair, maps, step, sigma_range, filled);
        } else {
            smooth(plan, pair, maps, step, sigma_range, filled);
        }
    }
}
