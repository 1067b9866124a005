use super::fill::invalid;
use mrfgs::backend::Peak;
use mrfgs::image::Plane;
use mrfgs::refine::flag;

/// Confidence of each pixel: 16 for every 8 units that the rival is behind.
pub fn confidence(peaks: &Plane<Peak>, flags: &mut Plane<u8>, floor: u32) -> Plane<u8> {
    let (width, height) = peaks.size();
    Plane::from_fn(width, height, |x, y| {
        if invalid(flags[(x, y)]) {
            return 0;
        }
        let peak = peaks[(x, y)];
        let confidence = ((i64::from(peak.rival) - i64::from(peak.best)) * 16 / 8).min(255);
        if confidence < i64::from(floor) {
            flags[(x, y)] |= flag::LOW_CONFIDENCE;
        }
        confidence as u8
    })
}
