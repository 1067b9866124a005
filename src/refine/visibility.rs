use super::flag;
use crate::backend::Estimate;
use crate::image::Plane;

/// Flags of each pixel by the map of the right view: [`flag::OUTSIDE`] where the match is outside the right image,
/// [`flag::OCCLUDED`] where the right pixel's own label differs by more than one.
#[must_use]
pub fn visibility(estimate: &Estimate, min: i32) -> Plane<u8> {
    let (width, height) = estimate.peaks.size();
    Plane::from_fn(width, height, |x, y| {
        let label = estimate.peaks[(x, y)].label;
        let xr = x as i64 - i64::from(min) - i64::from(label);
        if xr < 0 || xr >= width as i64 {
            flag::OUTSIDE
        } else if estimate.right[(xr as usize, y)].abs_diff(label) > 1 {
            flag::OCCLUDED
        } else {
            0
        }
    })
}
