use super::Finest;
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::flag;
use mrfgs::options::Nearer;

/// Whether a pixel's disparity is rejected before the fill.
pub fn invalid(validity: i32) -> bool {
    [flag::OUTSIDE, flag::OCCLUDED, flag::SPECKLE, flag::TIE, flag::OUTVOTED, flag::MASKED]
        .iter()
        .any(|&bit| validity & i32::from(bit) != 0)
}

/// Fills the invalid pixels that are not masked.
pub fn fill(plan: &Plan, maps: &mut Finest) {
    let (width, height) = maps.disparity.size();
    let (old, old_flags) = (maps.disparity.clone(), maps.validity.clone());
    let valid = |x: usize, y: usize| !invalid(old_flags[(x, y)]);
    // The value at column x of row y once the row is filled from its own valid pixels.
    let on_row = |x: usize, y: usize| {
        let left = (0..=x).rev().find(|&x| valid(x, y)).map(|x| old[(x, y)]);
        let right = (x..width).find(|&x| valid(x, y)).map(|x| old[(x, y)]);
        let sides = left.into_iter().chain(right);
        match plan.method.refinement.nearer {
            Nearer::Larger => sides.min(),
            Nearer::Smaller => sides.max(),
        }
    };
    for y in 0..height {
        for x in 0..width {
            if valid(x, y) || old_flags[(x, y)] & i32::from(flag::MASKED) != 0 {
                continue;
            }
            // Rows by distance, the upper one first on ties.
            let value = (0..height)
                .flat_map(|step| [y.checked_sub(step), Some(y + step)])
                .flatten()
                .filter(|&row| row < height)
                .find_map(|row| on_row(x, row));
            if let Some(value) = value {
                maps.disparity[(x, y)] = value;
                maps.validity[(x, y)] |= i32::from(flag::FILLED);
            }
        }
    }
}
