//! Limits that leave uncertain or distant pixels out of the outputs.

use std::borrow::Cow;

use mrfgs::depth::Rig;
use mrfgs::image::Plane;
use mrfgs::maps::{FRACTION, Maps, flag};
use serde::Serialize;

use crate::args::depth;

#[derive(clap::Args, Clone, Copy, Serialize)]
pub(crate) struct Limits {
    /// Drops pixels below this confidence (0 to 255), and filled ones, from OUTPUT, previews, depths and points
    #[arg(long, value_name = "N")]
    #[serde(skip_serializing_if = "Option::is_none")]
    min_confidence: Option<u8>,
    /// Drops depths and points beyond this depth, in the unit of the baseline
    #[arg(long, value_name = "Z", allow_negative_numbers = true, value_parser = depth)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) clip_depth: Option<f64>,
}

impl Limits {
    /// Whether a confidence limit was given.
    pub(crate) fn takes_confidence(self) -> bool {
        self.min_confidence.is_some()
    }

    /// Removes disparities of low confidence and filled ones from `map`, which belongs to `maps`.
    pub(super) fn sure(self, mut map: Plane<f32>, maps: &Maps) -> Plane<f32> {
        if let Some(least) = self.min_confidence {
            let pixels = maps.confidence.data().iter().zip(maps.validity.data());
            for (d, (confidence, validity)) in map.data_mut().iter_mut().zip(pixels) {
                if *confidence < least || validity & flag::FILLED != 0 {
                    *d = f32::INFINITY;
                }
            }
        }
        map
    }

    /// The depth at disparity `d`, unless it is beyond the limit.
    fn depth(self, rig: &Rig, d: f64) -> Option<f64> {
        rig.depth(d).filter(|depth| self.clip_depth.is_none_or(|limit| *depth <= limit))
    }

    /// Removes disparities beyond the depth limit from `map`.
    pub(super) fn near(self, map: Plane<f32>, rig: &Rig) -> Plane<f32> {
        if self.clip_depth.is_none() {
            return map;
        }
        map.map(|d| self.depth(rig, f64::from(*d)).map_or(f32::INFINITY, |_| *d))
    }

    /// The maps, with uncertain and distant pixels marked as low confidence so that they give no points.
    pub(super) fn trusted<'a>(self, maps: &'a Maps, rig: &Rig) -> Cow<'a, Maps> {
        if self.min_confidence.is_none() && self.clip_depth.is_none() {
            return Cow::Borrowed(maps);
        }
        let mut maps = maps.clone();
        let pixels = maps.disparity.data().iter().zip(maps.confidence.data());
        for (validity, (d, confidence)) in maps.validity.data_mut().iter_mut().zip(pixels) {
            let is_far = self.depth(rig, f64::from(*d) / f64::from(FRACTION)).is_none();
            if is_far || self.min_confidence.is_some_and(|least| *confidence < least) {
                *validity |= flag::LOW_CONFIDENCE;
            }
        }
        Cow::Owned(maps)
    }
}
