//! What is known of a pair before it is matched.

use crate::Thrown;
use crate::object::object;
use crate::pair::StereoPair;
use crate::words::thrown;
use mrfgs::depth::Rig;
use mrfgs::error::{Error, ReadError, Result};
use mrfgs::image::read::Reader;
use mrfgs::image::{Plane, read_cloud};
use mrfgs::prior::{Prior, PriorKind, PriorPoint, PriorUse};
use std::path::Path;
use std::sync::Arc;
use wasm_bindgen::JsValue;
use wasm_bindgen::prelude::wasm_bindgen;

#[wasm_bindgen]
impl StereoPair {
    /// Takes known points of the left view: x, y, disparity and standard deviation of each, in pixels. Where the last is 0, it is
    /// `sigma`, or else the usual one.
    ///
    /// # Errors
    /// If a value is not a number or out of range, or no point lies inside the view.
    #[wasm_bindgen(js_name = "knowPoints")]
    pub fn know_points(&mut self, values: &[f64], sigma: Option<f64>) -> Thrown<()> {
        let other = sigma.unwrap_or(PriorKind::Points.usual_sigma());
        let points = values.as_chunks().0.iter().map(|&[x, y, disparity, sigma]| {
            let sigma = if sigma == 0.0 { other } else { sigma };
            PriorPoint { x, y, disparity, sigma }
        });
        self.know(Prior::points(self.pair.size(), points))
    }

    /// Takes a map of known disparities of the left view, in pixels, not finite where nothing is known. The standard deviation is that of
    /// each pixel in `sigmas`, or else `sigma`, or else the usual one. The kind is "points" or "surface"; without it the map decides.
    ///
    /// # Errors
    /// If a map has not the size of the view, a value is out of range, or there is no such kind.
    #[wasm_bindgen(js_name = "knowMap")]
    pub fn know_map(
        &mut self,
        disparity: Vec<f32>,
        sigma: Option<f64>,
        sigmas: Option<Vec<f32>>,
        kind: Option<String>,
    ) -> Thrown<()> {
        let (width, height) = self.pair.size();
        let plane = |values: Vec<f32>| {
            if values.len() == width * height {
                return Ok(Plane::new(width, height, values));
            }
            let count = values.len();
            Err(Error::Mismatch(format!("the prior has {count} values for {width} x {height} pixels")))
        };
        let known = || {
            let disparity = plane(disparity)?;
            let kind = match kind.as_deref() {
                None => PriorKind::of_map(&disparity),
                Some("points") => PriorKind::Points,
                Some("surface") => PriorKind::Surface,
                Some(kind) => return Err(Error::Mismatch(format!("there is no kind {kind:?} of priors"))),
            };
            match sigmas {
                Some(sigmas) => Prior::map_with(kind, &disparity, &plane(sigmas)?),
                None => Prior::map(kind, &disparity, sigma.unwrap_or(kind.usual_sigma())),
            }
        };
        self.know(known())
    }

    /// Takes what a file knows of the left view, and tells its kind and the number of pixels that it knows. The file is one of these:
    ///
    /// - a list of points in the view, `.csv` or `.txt`,
    /// - a point cloud, `.ply` or `.xyz`, in the unit of the baseline and in the frame of the left camera as it took the image,
    /// - a map of depths, if its name has the word "depth": whole numbers in millimetres, others in metres,
    /// - a disparity map.
    ///
    /// A map has the shape of the view. Clouds and depths need the cameras.
    ///
    /// # Errors
    /// If the file is none of these, does not fit the view, or lacks the cameras.
    #[wasm_bindgen(js_name = "knowFile")]
    pub fn know_file(&mut self, bytes: Vec<u8>, name: &str) -> Thrown<JsValue> {
        let known = self.of_file(bytes, Path::new(name)).map_err(|error| match error {
            Error::Mismatch(reason) => Error::Mismatch(format!("{name}: {reason}")),
            error => error,
        });
        self.know(known)?;
        let found = self.prior.as_ref().map(|prior| (prior.kind(), prior.count()));
        Ok(found.map_or(JsValue::UNDEFINED, |(kind, given)| {
            object(&[("kind", named(kind).into()), ("given", given.into())])
        }))
    }
}

impl StereoPair {
    fn know(&mut self, known: Result<Prior>) -> Thrown<()> {
        self.prior = Some(Arc::new(known.map_err(thrown)?));
        Ok(())
    }

    /// The prior in a file.
    fn of_file(&self, bytes: Vec<u8>, name: &Path) -> Result<Prior> {
        let size = self.pair.size();
        if ends_in(name, &["csv", "txt"]) {
            let text = str::from_utf8(&bytes).map_err(|_| Error::Mismatch("it is not UTF-8 text".into()))?;
            return Prior::points(size, PriorPoint::listed(text, None)?);
        }
        if ends_in(name, &["ply", "xyz"]) {
            let rig = self.cameras("points of the scene")?;
            let points = read_cloud::positions_in_memory(name, bytes)?;
            return rig.prior(size, points, PriorKind::Points.usual_sigma());
        }
        let is_depth = name.to_string_lossy().to_lowercase().contains("depth");
        let map = if is_depth { self.depths(&bytes, name)? } else { disparities(size, &bytes, name)? };
        let kind = PriorKind::of_map(&map);
        Prior::resized(kind, &map, size, kind.usual_sigma())
    }

    /// The cameras, which a file that holds `what` needs.
    fn cameras(&self, what: &str) -> Result<&Rig> {
        let needed = || Error::Mismatch(format!("it holds {what}: give it with a calibration of the pair"));
        self.rig.as_ref().ok_or_else(needed)
    }

    /// A map of depths as disparities of the view, of the size of the map.
    fn depths(&self, bytes: &[u8], name: &Path) -> Result<Plane<f32>> {
        let rig = self.cameras("depths")?;
        let reason = "it holds depths in millimetres or metres: add a line `unit=` with mm, cm or m, that of the baseline, to the calibration";
        let needed = || Error::Mismatch(reason.into());
        let baseline = rig.unit().millimetres().ok_or_else(needed)?;
        let reader = Reader::default();
        let (map, [whole, other]) = (reader.scaled_disparity_in_memory(name, bytes, 1.0), MILLIMETRES);
        let (map, unit) = match map {
            Err(Error::Read { cause: ReadError::NeedlessScale, .. }) => {
                (reader.disparity_in_memory(name, bytes)?, other)
            }
            map => (map?, whole),
        };
        let scale = unit / baseline;
        Ok(map.map(|&depth| {
            let depth = f64::from(depth);
            let known = depth > 0.0 && depth.is_finite();
            if known { rig.disparity(depth * scale) as f32 } else { f32::INFINITY }
        }))
    }
}

/// A map of disparities in pixels of a view of this size, of its own size.
fn disparities((width, _): (usize, usize), bytes: &[u8], name: &Path) -> Result<Plane<f32>> {
    let map = Reader::default().disparity_in_memory(name, bytes)?;
    let own = map.size().0;
    let stretch = if own == width { 1.0 } else { width as f32 / own as f32 };
    Ok(map.map(|d| d * stretch))
}

/// The millimetres in a unit of depths that are whole numbers, and of others.
const MILLIMETRES: [f64; 2] = [1.0, 1000.0];

/// Whether a name ends in one of these, whatever their case.
fn ends_in(name: &Path, ends: &[&str]) -> bool {
    let extension = name.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    ends.iter().any(|end| extension.eq_ignore_ascii_case(end))
}

fn named(kind: PriorKind) -> &'static str {
    match kind {
        PriorKind::Points => "points",
        PriorKind::Surface => "surface",
    }
}

/// How much of a prior was used: `{ kind, given, dropped, trust }`.
pub(crate) fn told(used: PriorUse) -> JsValue {
    let PriorUse { kind, given, dropped, trust } = used;
    object(&[
        ("kind", named(kind).into()),
        ("given", given.into()),
        ("dropped", dropped.into()),
        ("trust", trust.into()),
    ])
}
