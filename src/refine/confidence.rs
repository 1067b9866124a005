use super::flag;
use crate::backend::Peak;
use crate::image::Plane;

/// Confidence 0 ..= 255 of each pixel: how far the best rival, a label more than one away, is behind the optimum, in
/// half units (eighths of a nat); 255 beyond that and where there is no rival, 0 for invalid pixels. Sets [`flag::LOW_CONFIDENCE`] on valid pixels below `floor`.
pub fn confidence(peaks: &Plane<Peak>, flags: &mut Plane<u8>, floor: u32) -> Plane<u8> {
    let mut out = peaks.map(|peak| (2 * u32::from(peak.rival - peak.best)).min(255) as u8);
    for (confidence, flags) in out.data_mut().iter_mut().zip(flags.data_mut()) {
        if *flags & flag::INVALID != 0 {
            *confidence = 0;
        } else if u32::from(*confidence) < floor {
            *flags |= flag::LOW_CONFIDENCE;
        }
    }
    out
}
