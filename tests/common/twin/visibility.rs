use mrfgs::backend::Estimate;
use mrfgs::image::Plane;
use mrfgs::refine::flag;

/// Flags of each pixel by the map of the right view.
pub fn visibility(estimate: &Estimate, min: i32) -> Plane<u8> {
    let (width, height) = estimate.peaks.size();
    Plane::from_fn(width, height, |x, y| {
        let label = i64::from(estimate.peaks[(x, y)].label);
        let right = x as i64 - (i64::from(min) + label);
        if right < 0 || right >= width as i64 {
            return flag::OUTSIDE;
        }
        let theirs = i64::from(estimate.right[(right as usize, y)]);
        if (theirs - label).abs() > 1 { flag::OCCLUDED } else { 0 }
    })
}
