use super::Finest;
use mrfgs::image::Pair;
use mrfgs::low_level::backend::NO_LABEL;
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::flag;
use mrfgs::options::LeftRightCheck;

/// Validity of each pixel, from the mask and the label map of the right view.
pub fn left_right_check(plan: &Plan, pair: &Pair, maps: &mut Finest) {
    let (width, height) = pair.size();
    for y in 0..height {
        for x in 0..width {
            let label = i64::from(maps.label[(x, y)]);
            let right = x as i64 - (i64::from(plan.range.min) + label);
            let inside = right >= 0 && right < width as i64;
            let reason = if pair.left().masked[(x, y)] {
                flag::MASKED
            } else if maps.label[(x, y)] == i32::from(NO_LABEL) {
                flag::OUTSIDE
            } else if plan.method.refinement.left_right_check == LeftRightCheck::Off {
                0
            } else if !inside {
                flag::OUTSIDE
            } else if (i64::from(maps.right_label[(right as usize, y)]) - label).abs() > 1 {
                flag::OCCLUDED
            } else {
                0
            };
            maps.validity[(x, y)] = reason.into();
        }
    }
}
