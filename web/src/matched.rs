//! What comes out: maps, pictures, files and points.

use crate::Thrown;
use crate::object::set;
use crate::pair::{Cameras, StereoPair, rgba};
use crate::words::{error, thrown, warning};
use js_sys::Array;
use mrfgs::check::Warning;
use mrfgs::colour::{self, ColourMap};
use mrfgs::image::cloud::{Cloud, Point};
use mrfgs::image::picture::Picture;
use mrfgs::image::ply;
use mrfgs::image::write::Writer;
use mrfgs::image::{Plane, Rect};
use std::path::Path;
use wasm_bindgen::prelude::wasm_bindgen;

/// The maps of a pair, and what made them.
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

    /// Iterations done.
    #[wasm_bindgen(getter)]
    pub fn iterations(&self) -> u32 {
        self.matched.iterations
    }

    /// What ran the stages, for people.
    #[wasm_bindgen(getter)]
    pub fn device(&self) -> String {
        self.matched.ran_on.clone()
    }

    /// Why it did not run on the GPU, where that is so.
    #[wasm_bindgen(getter)]
    pub fn note(&self) -> Option<String> {
        self.matched.note.as_ref().map(error)
    }

    /// What is probably wrong with the pair or the range: `{ text, remedy }`, where the remedy "widen" has the range to take, `min` and
    /// `max`.
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

    /// What was done to the pair so that it could be matched, in words; empty where nothing was.
    #[wasm_bindgen(getter)]
    pub fn corrected(&self) -> String {
        self.matched.conditioning.to_string()
    }

    /// The number of tiles that it was cut into; 1 where it was not.
    #[wasm_bindgen(getter)]
    pub fn tiles(&self) -> usize {
        self.matched.tiles.count()
    }

    /// The disparity of every pixel, in pixels; +Infinity where there is none.
    #[must_use]
    pub fn disparity(&self) -> Vec<f32> {
        self.matched.disparity().into_data()
    }

    /// The confidence of every pixel, 0 to 255.
    #[must_use]
    pub fn confidence(&self) -> Vec<u8> {
        self.matched.confidence().data().to_vec()
    }

    /// Why each pixel is what it is.
    #[must_use]
    pub fn validity(&self) -> Vec<u8> {
        self.matched.validity().data().to_vec()
    }

    /// The map "disparity", "raw", "confidence" or "validity" as a picture, RGBA; the first two in the colours "turbo", "viridis" or
    /// "grey", from the disparity `min` to `max`.
    ///
    /// # Errors
    /// Where there is no such map, or there are no such colours.
    pub fn picture(&self, map: &str, colours: &str, min: f32, max: f32) -> Thrown<Vec<u8>> {
        let maps = &self.matched.maps;
        let picture = match map {
            "confidence" => colour::grey(&maps.confidence),
            "validity" => colour::validity(&maps.validity),
            _ => colour::preview(&self.disparities(map)?, min, max, self::colours(colours)?),
        };
        Ok(rgba(&picture.crop(&Rect::whole((self.width(), self.height())))))
    }

    /// The map "disparity" or "raw" as the program writes it to PFM.
    ///
    /// # Errors
    /// Where there is no such map.
    pub fn pfm(&self, map: &str) -> Thrown<Vec<u8>> {
        Writer::default()
            .encode_disparity(Path::new("disparity.pfm"), &self.disparities(map)?)
            .map_err(thrown)
    }

    /// The map "disparity", "raw", "confidence" or "validity" as the program writes it to PNG: disparities times 256 in 16 bits.
    ///
    /// # Errors
    /// Where there is no such map, and for disparities that PNG cannot hold.
    pub fn png(&self, map: &str) -> Thrown<Vec<u8>> {
        let path = Path::new("disparity.png");
        match map {
            "confidence" => self.matched.confidence().png(path),
            "validity" => self.matched.validity().png(path),
            _ => Writer::default().encode_disparity(path, &self.disparities(map)?),
        }
        .map_err(thrown)
    }

    /// The points that were measured and are trusted, with the colours of `pair`.
    #[must_use]
    pub fn points(&self, cameras: &Cameras, pair: &StereoPair) -> Points {
        Points { points: self.cloud(cameras, pair).points }
    }

    /// The points of at least this confidence as the program writes them to PLY.
    #[must_use]
    pub fn ply(&self, cameras: &Cameras, pair: &StereoPair, least_confidence: u8) -> Vec<u8> {
        let mut cloud = self.cloud(cameras, pair);
        cloud.points.retain(|point| point.confidence >= least_confidence);
        ply::encode(&cloud)
    }

    /// The number of pixels in which any map differs, of all where the sizes do.
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

/// A cloud of points, in the frame of the left camera: x to the right, y down, z forward.
#[wasm_bindgen]
pub struct Points {
    points: Vec<Point>,
}

#[wasm_bindgen]
impl Points {
    /// The number of points.
    #[wasm_bindgen(getter)]
    pub fn count(&self) -> usize {
        self.points.len()
    }

    /// x, y and z of each.
    #[wasm_bindgen(getter)]
    pub fn positions(&self) -> Vec<f32> {
        self.points.iter().flat_map(|point| point.position).collect()
    }

    /// Red, green and blue of each.
    #[wasm_bindgen(getter)]
    pub fn colours(&self) -> Vec<u8> {
        self.points.iter().flat_map(|point| point.colour).collect()
    }

    /// The confidence of each.
    #[wasm_bindgen(getter)]
    pub fn confidences(&self) -> Vec<u8> {
        self.points.iter().map(|point| point.confidence).collect()
    }
}

/// The colours called `name`.
pub(crate) fn colours(name: &str) -> Thrown<ColourMap> {
    match name {
        "turbo" => Ok(ColourMap::Turbo),
        "viridis" => Ok(ColourMap::Viridis),
        "grey" => Ok(ColourMap::Grey),
        _ => Err(js_sys::Error::new(&format!("there are no colours {name:?}"))),
    }
}
