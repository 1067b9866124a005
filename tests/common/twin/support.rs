use super::Finest;
use super::fill::invalid;
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::flag;

/// The mean confidence of the neighbourhood of each pixel; neighbours with another disparity count 0.
pub fn support(plan: &Plan, maps: &mut Finest) {
    let (width, height) = plan.size();
    let before = maps.clone();
    let inside = |at: usize, by: i64, count: usize| (at as i64 + by).clamp(0, count as i64 - 1) as usize;
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let at = (x, y);
        if invalid(before.validity[at]) {
            maps.confidence[at] = 0;
            continue;
        }
        let mut sum = 0;
        for down in [-4, -2, 0, 2, 4] {
            for across in [-4, -2, 0, 2, 4] {
                let place = (inside(x, across, width), inside(y, down, height));
                if (before.disparity[place] - before.disparity[at]).abs() <= 512 {
                    sum += before.confidence[place];
                }
            }
        }
        maps.confidence[at] = sum / 25;
        if i64::from(sum / 25) < i64::from(plan.method.refinement.confidence_floor) {
            maps.validity[at] |= i32::from(flag::LOW_CONFIDENCE);
        }
    }
}
