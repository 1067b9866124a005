use super::Finest;
use super::fill::invalid;
use mrfgs::low_level::plan::Plan;

/// Confidence of each pixel: 16 for every 8 units of margin between the optimum and its runner-up.
pub fn confidence(plan: &Plan, maps: &mut Finest) {
    let (width, height) = plan.size();
    for y in 0..height {
        for x in 0..width {
            let at = (x, y);
            let lead = ((maps.runner_up[at] - maps.best[at]) * 16 / 8).min(255);
            maps.confidence[at] = if invalid(maps.validity[at]) { 0 } else { lead };
        }
    }
}
