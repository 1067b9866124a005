//! What is known of a pair before it is matched.

use crate::Thrown;
use crate::object::object;
use crate::pair::StereoPair;
use crate::words::thrown;
use mrfgs::error::{Error, Result};
use mrfgs::image::Plane;
use mrfgs::image::read::Reader;
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

    /// Takes what a file knows of the left view, and tells its kind and the number of pixels that it knows. The file is a disparity map of
    /// the size of the view, or a list of points if its name ends in .csv or .txt.
    ///
    /// # Errors
    /// If the file is neither, or does not fit the view.
    #[wasm_bindgen(js_name = "knowFile")]
    pub fn know_file(&mut self, bytes: &[u8], name: &str) -> Thrown<JsValue> {
        let size = self.pair.size();
        let known = of_file(size, bytes, Path::new(name)).map_err(|error| match error {
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
}

/// The prior in a file, of a view of (width, height) pixels.
fn of_file(size: (usize, usize), bytes: &[u8], name: &Path) -> Result<Prior> {
    let extension = name.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    if ["csv", "txt"].iter().any(|list| extension.eq_ignore_ascii_case(list)) {
        let text = str::from_utf8(bytes).map_err(|_| Error::Mismatch("it is not UTF-8 text".into()))?;
        return Prior::points(size, PriorPoint::listed(text, None)?);
    }
    let map = Reader::default().disparity_in_memory(name, bytes)?;
    let ((w, h), (width, height)) = (map.size(), size);
    if map.size() != size {
        let reason =
            format!("it has {w} x {h} pixels and the left view {width} x {height}: give a map of that size");
        return Err(Error::Mismatch(reason));
    }
    let kind = PriorKind::of_map(&map);
    Prior::map(kind, &map, kind.usual_sigma())
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
