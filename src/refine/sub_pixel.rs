use crate::backend::Peak;
use crate::image::Plane;
use crate::options::SubPixel;

/// Fixed-point units of disparity in one pixel.
pub const FRACTION: i32 = 256;

/// Disparity of each pixel in 1/256 px, from the label `min + index` and the fit around it; within half a pixel of the
/// label. With b the belief of the optimum, l and u those of the labels below and above, and rounding towards minus
/// infinity after adding half:
/// - parabola: 256 (l - u) / (2 (l - 2 b + u));
/// - equiangular: 256 (l - u) / (2 (max(l, u) - b)).
///
/// At the ends of the range, and where all three are equal, the label stays.
#[must_use]
pub fn sub_pixel(peaks: &Plane<Peak>, min: i32, method: SubPixel) -> Plane<i32> {
    peaks.map(|peak| (min + i32::from(peak.label)) * FRACTION + offset(peak, method))
}

fn offset(peak: &Peak, method: SubPixel) -> i32 {
    if peak.lower == u16::MAX || peak.upper == u16::MAX {
        return 0;
    }
    let (below, best, above) = (i32::from(peak.lower), i32::from(peak.best), i32::from(peak.upper));
    let slope = match method {
        SubPixel::None => 0,
        SubPixel::Parabola => below - 2 * best + above,
        SubPixel::Equiangular => below.max(above) - best,
    };
    if slope == 0 {
        return 0;
    }
    (FRACTION * (below - above) + slope).div_euclid(2 * slope)
}
