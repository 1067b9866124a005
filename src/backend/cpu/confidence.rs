//! How sure each pixel is: see [`crate::backend::Stage::Confidence`].

use super::Finest;
use crate::maps::flag;

pub(super) fn run(floor: u32, maps: &mut Finest) {
    let Finest { optima, validity, confidence, .. } = maps;
    let pixels = confidence.data_mut().iter_mut().zip(validity.data_mut()).zip(optima.data());
    for ((confidence, flags), peak) in pixels {
        let lead = (2 * u32::from(peak.runner_up - peak.best)).min(255);
        if *flags & flag::INVALID != 0 {
            *confidence = 0;
        } else {
            *confidence = lead as u8;
            if lead < floor {
                *flags |= flag::LOW_CONFIDENCE;
            }
        }
    }
}
