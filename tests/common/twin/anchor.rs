use super::Finest;
use super::fill::invalid;
use mrfgs::image::Plane;
use mrfgs::maps::flag;

/// Gives the pixels without a trusted match their anchors; `None` where there is none.
pub fn anchor(anchors: &Plane<Option<i32>>, maps: &mut Finest) {
    let (width, height) = maps.disparity.size();
    for at in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let masked = maps.validity[at] & i32::from(flag::MASKED) != 0;
        if let Some(anchor) = anchors[at].filter(|_| invalid(maps.validity[at]) && !masked) {
            maps.disparity[at] = anchor;
            maps.validity[at] = flag::FILLED.into();
            maps.confidence[at] = 64;
        }
    }
}
