//! Results of a match: maps, pictures, files and points.

use crate::Thrown;
use crate::object::set;
use crate::pair::{Cameras, StereoPair, rgba};
use crate::prior::told;
use crate::words::{error, thrown, warning};
use js_sys::Array;
use mrfgs::check::Warning;
use mrfgs::colour::{self, ColourMap};
use mrfgs::image::cloud::Cloud;
use mrfgs::image::picture::Picture;
use mrfgs::image::ply;
use mrfgs::image::write::Writer;
use mrfgs::image::{Plane, Rect};
use std::path::Path;
use wasm_bindgen::JsValue;
use wasm_bindgen::prelude::wasm_bindgen;

/// The maps of a pair, and how they were computed.
#[wasm_bindgen]
pub struct Matched {
    pub(crate) matched: mrfgs::Matched,
}

#[wasm_bindgen]
impl Matched {
    /// Width in pixels.
    #[wasm_bindgen(getter)]
    pub fn width(&self) -> usize {
        self.matched.maps.disparity.width()
    }

    /// Height in pixels.
    #[wasm_bindgen(getter)]
    pub fn height(&self) -> usize {
        self.matched.maps.disparity.height()
    }

    /// The least disparity that was searched.
    #[wasm_bindgen(getter)]
    pub fn min(&self) -> i32 {
        self.matched.range().min
    }

    /// The largest disparity that was searched.
    #[wasm_bindgen(getter)]
    pub fn max(&self) -> i32 {
        self.matched.range().max
    }

    /// Number of iterations done.
    #[wasm_bindgen(getter)]
    pub fn iterations(&self) -> u32 {
        self.matched.iterations
    }

    /// The device that ran the match, for display.
    #[wasm_bindgen(getter)]
    pub fn device(&self) -> String {
        self.matched.ran_on.clone()
    }

    /// Why the match did not run on the GPU, if it was to.
    #[wasm_bindgen(getter)]
    pub fn note(&self) -> Option<String> {
        self.matched.note.as_ref().map(error)
    }

    /// Likely problems of the pair or the range: `{ text, remedy }`. The remedy "widen" also has the range to use, `min` and `max`.
    #[must_use]
    pub fn warnings(&self) -> Array {
        let of = |cause: &Warning| {
            let said = warning(cause, None);
            if let Warning::Clipped { upper, .. } = cause {
                let range = self.matched.range();
                let more = (range.labels() / 2) as i32;
                let (min, max) =
                    if *upper { (range.min, range.max + more) } else { (range.min - more, range.max) };
                for (end, value) in [("min", min), ("max", max)] {
                    set(&said, end, value.into());
                }
            }
            said
        };
        self.matched.warnings().iter().map(of).collect()
    }

    /// The corrections made to the pair before matching, in words; empty if there were none.
    #[wasm_bindgen(getter)]
    pub fn corrected(&self) -> String {
        self.matched.conditioning.to_string()
    }

    /// How much of what was known of the pair was used: `{ kind, given, dropped, trust }`; undefined if nothing was known.
    #[must_use]
    pub fn prior(&self) -> JsValue {
        self.matched.prior.map_or(JsValue::UNDEFINED, told)
    }

    /// Number of tiles; 1 if the pair was not split.
    #[wasm_bindgen(getter)]
    pub fn tiles(&self) -> usize {
        self.matched.tiles.count()
    }

    /// Disparity of each pixel in pixels; +Infinity where missing.
    #[must_use]
    pub fn disparity(&self) -> Vec<f32> {
        self.matched.disparity().into_data()
    }

    /// Confidence of each pixel, 0 to 255.
    #[must_use]
    pub fn confidence(&self) -> Vec<u8> {
        self.matched.confidence().data().to_vec()
    }

    /// Flags of each pixel: `reasons` explains the bits.
    #[must_use]
    pub fn validity(&self) -> Vec<u8> {
        self.matched.validity().data().to_vec()
    }

    /// The map "disparity", "raw", "confidence" or "validity" as an RGBA picture. Disparities from `min` to `max` use the colour map
    /// "turbo", "viridis" or "grey".
    ///
    /// # Errors
    /// If there is no such map or colour map.
    pub fn picture(&self, map: &str, colours: &str, min: f32, max: f32) -> Thrown<Vec<u8>> {
        let maps = &self.matched.maps;
        let picture = match map {
            "confidence" => colour::grey(&maps.confidence),
            "validity" => colour::validity(&maps.validity),
            _ => colour::preview(&self.disparities(map)?, min, max, self::colours(colours)?),
        };
        Ok(rgba(&picture.crop(&Rect::whole((self.width(), self.height())))))
    }

    /// The map "disparity" or "raw" as a PFM file.
    ///
    /// # Errors
    /// If there is no such map.
    pub fn pfm(&self, map: &str) -> Thrown<Vec<u8>> {
        Writer::default()
            .encode_disparity(Path::new("disparity.pfm"), &self.disparities(map)?)
            .map_err(thrown)
    }

    /// The map "disparity", "raw", "confidence" or "validity" as a PNG file: disparities times 256 in 16 bits.
    ///
    /// # Errors
    /// If there is no such map, or a disparity does not fit into PNG.
    pub fn png(&self, map: &str) -> Thrown<Vec<u8>> {
        let path = Path::new("disparity.png");
        match map {
            "confidence" => self.matched.confidence().png(path),
            "validity" => self.matched.validity().png(path),
            _ => Writer::default().encode_disparity(path, &self.disparities(map)?),
        }
        .map_err(thrown)
    }

    /// The points of at least this confidence as a PLY file.
    #[must_use]
    pub fn ply(&self, cameras: &Cameras, pair: &StereoPair, least_confidence: u8) -> Vec<u8> {
        let mut cloud = self.cloud(cameras, pair);
        cloud.points.retain(|point| point.confidence >= least_confidence);
        ply::encode(&cloud)
    }

    /// Number of pixels that differ in any map; all of them if the sizes differ.
    #[must_use]
    pub fn differing(&self, other: &Matched) -> usize {
        let (a, b) = (&self.matched.maps, &other.matched.maps);
        if a.disparity.size() != b.disparity.size() {
            return a.disparity.data().len();
        }
        let differs = |i: &usize| {
            let i = *i;
            (a.disparity.data()[i], a.raw.data()[i]) != (b.disparity.data()[i], b.raw.data()[i])
                || (a.confidence.data()[i], a.validity.data()[i])
                    != (b.confidence.data()[i], b.validity.data()[i])
        };
        (0..a.disparity.data().len()).filter(differs).count()
    }
}

impl Matched {
    fn disparities(&self, map: &str) -> Thrown<Plane<f32>> {
        match map {
            "disparity" => Ok(self.matched.disparity()),
            "raw" => Ok(self.matched.raw()),
            _ => Err(js_sys::Error::new(&format!("there is no map {map:?}"))),
        }
    }

    fn cloud(&self, cameras: &Cameras, pair: &StereoPair) -> Cloud {
        cameras.rig.cloud(&self.matched.maps, pair.pair.left())
    }
}

/// The colour map named `name`.
pub(crate) fn colours(name: &str) -> Thrown<ColourMap> {
    match name {
        "turbo" => Ok(ColourMap::Turbo),
        "viridis" => Ok(ColourMap::Viridis),
        "grey" => Ok(ColourMap::Grey),
        _ => Err(js_sys::Error::new(&format!("there is no colour map {name:?}: use turbo, viridis or grey"))),
    }
}
