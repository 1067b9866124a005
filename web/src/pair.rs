//! Inputs of a match: a pair, the range to search, and the cameras.

use crate::Thrown;
use crate::words::{By, thrown, warning};
use js_sys::Array;
use mrfgs::check;
use mrfgs::depth::Rig;
use mrfgs::error::{Error, RangeError};
use mrfgs::image::calib::{Calibration, Camera};
use mrfgs::image::raster::{Raster, Sample};
use mrfgs::image::read::Reader;
use mrfgs::image::{Pair, Plane};
use mrfgs::options::DisparityRange;
use mrfgs::prior::Prior;
use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;
use wasm_bindgen::prelude::wasm_bindgen;

/// A rectified pair.
#[wasm_bindgen]
pub struct StereoPair {
    pub(crate) pair: Pair,
    /// How it was rectified, if it had to be.
    pub(crate) by: Option<By>,
    /// Horizontal distance of the principal points in pixels, if a calibration has rectified the pair.
    pub(crate) doffs: Option<f64>,
    /// The cameras, if they are known, with points in the frame of the left camera that took the image.
    pub(crate) rig: Option<Rig>,
    /// What is known of the left view.
    pub(crate) prior: Option<Arc<Prior>>,
}

#[wasm_bindgen]
impl StereoPair {
    /// Decodes a pair from two files, whose names appear in errors. The orientation stored in the files is applied.
    ///
    /// # Errors
    /// If a file is not an image, or the images differ in size.
    #[wasm_bindgen(constructor)]
    pub fn new(left: &[u8], left_name: &str, right: &[u8], right_name: &str) -> Thrown<Self> {
        let files = ((Path::new(left_name), left), (Path::new(right_name), right));
        let reader = Reader { orient: true, ..Reader::default() };
        Ok(Self::of(reader.pair_in_memory(files.0, files.1).map_err(thrown)?, None))
    }

    /// A pair from memory: rows of grey, grey and alpha, RGB or RGBA without gaps. The number of samples gives the number of channels.
    ///
    /// # Errors
    /// If samples are missing, or the images differ in size.
    pub fn of_samples8(
        left: &[u8],
        left_width: usize,
        left_height: usize,
        right: &[u8],
        right_width: usize,
        right_height: usize,
    ) -> Thrown<Self> {
        of_samples((left, (left_width, left_height)), (right, (right_width, right_height)))
    }

    /// Like `of_samples8`, with 16-bit samples.
    ///
    /// # Errors
    /// If samples are missing, or the images differ in size.
    pub fn of_samples16(
        left: &[u16],
        left_width: usize,
        left_height: usize,
        right: &[u16],
        right_width: usize,
        right_height: usize,
    ) -> Thrown<Self> {
        of_samples((left, (left_width, left_height)), (right, (right_width, right_height)))
    }

    /// Width in pixels.
    #[wasm_bindgen(getter)]
    pub fn width(&self) -> usize {
        self.pair.size().0
    }

    /// Height in pixels.
    #[wasm_bindgen(getter)]
    pub fn height(&self) -> usize {
        self.pair.size().1
    }

    /// The view "left" or "right" as RGBA.
    #[must_use]
    pub fn picture(&self, view: &str) -> Vec<u8> {
        let image = if view == "right" { self.pair.right() } else { self.pair.left() };
        rgba(&image.to_rgb8())
    }

    /// The disparity range found by sparse matching, if it finds enough matches.
    ///
    /// # Errors
    /// If there is not enough memory.
    pub fn range(&self) -> Thrown<Option<Range>> {
        let found = match self.doffs {
            Some(doffs) => check::range_of_cameras(&self.pair, doffs),
            None => check::range(&self.pair),
        };
        match found {
            Ok(range) => Ok(Some(Range { range, found: true })),
            Err(Error::Range(RangeError::NotFound { .. } | RangeError::NotRectified)) => Ok(None),
            Err(error) => Err(thrown(error)),
        }
    }

    /// Likely problems of the pair, and of the range if one is given: `{ text, remedy }`.
    #[must_use]
    pub fn warnings(&self, range: Option<Range>) -> Array {
        // Only a range from the user is informative.
        let given = range.filter(|range| !range.found).map(|range| range.range);
        check::warnings(&self.pair, given).iter().map(|cause| warning(cause, self.by.as_ref())).collect()
    }
}

impl StereoPair {
    /// A pair of which nothing else is known, perhaps rectified.
    pub(crate) fn of(pair: Pair, by: Option<By>) -> Self {
        Self { pair, by, doffs: None, rig: None, prior: None }
    }
}

fn of_samples<S: Sample>(left: (&[S], (usize, usize)), right: (&[S], (usize, usize))) -> Thrown<StereoPair> {
    Ok(StereoPair::of(pair_of_samples(left, right).map_err(thrown)?, None))
}

/// A pair of two views, each with its samples and its (width, height).
pub(crate) fn pair_of_samples<S: Sample>(
    left: (&[S], (usize, usize)),
    right: (&[S], (usize, usize)),
) -> mrfgs::Result<Pair> {
    fn view<S: Sample>((samples, (width, height)): (&[S], (usize, usize))) -> mrfgs::Result<Raster<'_>> {
        let pixels = width.saturating_mul(height);
        let channels = samples.len().checked_div(pixels).unwrap_or(0);
        Raster::new(width, height, channels, S::samples(Cow::Borrowed(samples)))
    }
    Pair::of_frames(view(left)?, view(right)?)
}

/// Disparities to search, in pixels, inclusive.
#[wasm_bindgen]
#[derive(Clone, Copy)]
pub struct Range {
    pub(crate) range: DisparityRange,
    /// Whether sparse matching found it, so that a match may widen it.
    pub(crate) found: bool,
}

#[wasm_bindgen]
impl Range {
    /// The disparities from `min` to `max`.
    ///
    /// # Errors
    /// If there are none, or too many.
    #[wasm_bindgen(constructor)]
    pub fn new(min: i32, max: i32) -> Thrown<Self> {
        Ok(Self { range: DisparityRange::new(min, max).map_err(thrown)?, found: false })
    }

    /// Marks the range as one from [`StereoPair::range`].
    #[must_use]
    pub fn found(self) -> Self {
        Self { found: true, ..self }
    }

    /// The least disparity.
    #[wasm_bindgen(getter)]
    pub fn min(&self) -> i32 {
        self.range.min
    }

    /// The largest disparity.
    #[wasm_bindgen(getter)]
    pub fn max(&self) -> i32 {
        self.range.max
    }
}

/// The cameras of a pair.
#[wasm_bindgen]
pub struct Cameras {
    camera: Camera,
    doffs: f64,
    baseline: f64,
    pub(crate) rig: Rig,
}

#[wasm_bindgen]
impl Cameras {
    /// Cameras with this focal length, principal point of the left camera, and horizontal distance of the principal points, in pixels.
    /// Points are in the unit of `baseline`: mm, cm, m or unknown.
    ///
    /// # Errors
    /// If focal length or baseline are not above 0, or for another unit.
    #[wasm_bindgen(constructor)]
    pub fn new(focal_length: f64, cx: f64, cy: f64, doffs: f64, baseline: f64, unit: &str) -> Thrown<Self> {
        let text = format!(
            "cam0=[{focal_length} 0 {cx}; 0 {focal_length} {cy}; 0 0 1]\ndoffs={doffs}\nbaseline={baseline}\nunit={unit}"
        );
        Self::of(&Calibration::of_text(Path::new("calib.txt"), &text).map_err(thrown)?)
    }

    /// Horizontal focal length in pixels.
    #[wasm_bindgen(getter)]
    pub fn focal_length(&self) -> f64 {
        self.camera.focal_length[0]
    }

    /// Column of the principal point.
    #[wasm_bindgen(getter)]
    pub fn cx(&self) -> f64 {
        self.camera.principal_point[0]
    }

    /// Row of the principal point.
    #[wasm_bindgen(getter)]
    pub fn cy(&self) -> f64 {
        self.camera.principal_point[1]
    }

    /// Horizontal distance of the principal points in pixels.
    #[wasm_bindgen(getter)]
    pub fn doffs(&self) -> f64 {
        self.doffs
    }

    /// Distance of the cameras, in `unit`.
    #[wasm_bindgen(getter)]
    pub fn baseline(&self) -> f64 {
        self.baseline
    }

    /// Unit of the baseline: mm, cm, m or unknown.
    #[wasm_bindgen(getter)]
    pub fn unit(&self) -> String {
        self.rig.unit().name().into()
    }
}

impl Cameras {
    /// The cameras of a calibration.
    ///
    /// # Errors
    /// If a value is missing.
    pub(crate) fn of(calibration: &Calibration) -> Thrown<Self> {
        let rig = Rig::new(calibration).map_err(thrown)?;
        let (Some(camera), Some(doffs), Some(baseline)) =
            (calibration.camera, calibration.doffs, calibration.baseline)
        else {
            unreachable!("a rig has all three")
        };
        Ok(Self { camera, doffs, baseline, rig })
    }
}

/// Converts a picture to RGBA for a canvas.
pub(crate) fn rgba(picture: &Plane<[u8; 3]>) -> Vec<u8> {
    picture.data().iter().flat_map(|&[r, g, b]| [r, g, b, u8::MAX]).collect()
}
