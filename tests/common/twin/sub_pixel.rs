use mrfgs::backend::Peak;
use mrfgs::image::Plane;
use mrfgs::options::SubPixel;

/// Disparity of each pixel in 1/256 px.
pub fn sub_pixel(peaks: &Plane<Peak>, min: i32, method: SubPixel) -> Plane<i32> {
    peaks.map(|peak| {
        let label = 256 * (i64::from(min) + i64::from(peak.label));
        i32::try_from(label + offset(peak, method)).unwrap()
    })
}

fn offset(peak: &Peak, method: SubPixel) -> i64 {
    let at_an_end = peak.lower == u16::MAX || peak.upper == u16::MAX;
    let (l, b, u) = (i64::from(peak.lower), i64::from(peak.best), i64::from(peak.upper));
    if at_an_end || (l == b && u == b) {
        return 0;
    }
    let twice_slope = match method {
        SubPixel::None => return 0,
        SubPixel::Parabola => 2 * (l - 2 * b + u),
        SubPixel::Equiangular => 2 * (l.max(u) - b),
    };
    // 256 (l - u) / twice_slope, plus a half, towards minus infinity: floats hold these fractions exactly enough, as
    // a quotient of integers is never closer to a whole number than 1 / (2 twice_slope).
    let exact = 256.0 * (l - u) as f64 / twice_slope as f64 + 0.5;
    let floor = exact.floor() as i64;
    assert!((2 * floor - 1) * twice_slope <= 512 * (l - u) && 512 * (l - u) < (2 * floor + 1) * twice_slope);
    floor
}
