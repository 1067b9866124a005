use super::Finest;
use super::median::{filled, smooth};
use mrfgs::image::Pair;
use mrfgs::low_level::plan::Plan;

/// The median of filled pixels, over samples four pixels apart.
pub fn fill_median(plan: &Plan, pair: &Pair, maps: &mut Finest) {
    smooth(plan, pair, maps, (4, 1), plan.method.refinement.median_sigma_range / 4.0, filled);
}
