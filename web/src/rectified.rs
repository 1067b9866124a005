//! Calibrations, and pairs rectified by a calibration or by their own matches.

use crate::Thrown;
use crate::pair::{Cameras, StereoPair};
use crate::words::{By, doubt, thrown};
use mrfgs::Error;
use mrfgs::calibration::{self, cameras::StereoCalibration};
use mrfgs::image::calib::Calibration;
use mrfgs::rectification::{Doubt, Options, Rectification};
use std::path::Path;
use wasm_bindgen::prelude::wasm_bindgen;

/// A stereo calibration in any format that the program reads.
#[wasm_bindgen]
pub struct Known {
    known: StereoCalibration,
    names: String,
}

#[wasm_bindgen]
impl Known {
    /// Reads the calibration from these files, whose names appear in errors.
    ///
    /// # Errors
    /// If the files are not a calibration, or a value is missing.
    #[wasm_bindgen(constructor)]
    pub fn new(names: Vec<String>, texts: Vec<String>) -> Thrown<Self> {
        let files: Vec<_> = names.iter().map(Path::new).zip(texts).collect();
        let known = calibration::of_texts(&files).map_err(thrown)?;
        Ok(Self { known, names: names.join(", ") })
    }

    /// Whether it is Middlebury's calib.txt, which is of images that are rectified already.
    #[wasm_bindgen(getter)]
    pub fn rectified(&self) -> bool {
        self.known.benchmark.is_some()
    }

    /// Whether no other file is missing: it is of images that are rectified already, or says the lenses and how the cameras stand.
    #[wasm_bindgen(getter)]
    pub fn whole(&self) -> bool {
        let StereoCalibration { lenses, pose, views, .. } = &self.known;
        self.rectified() || lenses.is_some() && (pose.is_some() || views.is_some())
    }

    /// What it says of images of this size that are rectified already; undefined where it does not say how they were rectified.
    ///
    /// # Errors
    /// Where it lacks a value.
    #[wasm_bindgen(js_name = "ofRectified")]
    pub fn of_rectified(&self, width: usize, height: usize) -> Thrown<Option<OfRectified>> {
        let calibration = self.known.of_rectified_images(Some((width, height))).map_err(thrown)?;
        Ok(calibration.map(|calibration| OfRectified { calibration, names: self.names.clone() }))
    }

    /// Rectifies a pair.
    ///
    /// # Errors
    /// If the calibration is incomplete, or for images of another size.
    pub fn rectify(&self, pair: &StereoPair) -> Thrown<Rectified> {
        let by = Rectification::for_pair(&self.known, &pair.pair, &Options::default());
        let by = by.map_err(|error| match error {
            Error::Mismatch(reason) => {
                js_sys::Error::new(&format!("{}: {reason}: give images of that size", self.names))
            }
            error => thrown(error),
        })?;
        let calibration = by.calibration().map_err(thrown)?;
        let cameras = Cameras::of(&calibration)?;
        let mut rectified = Rectified::new(&by, pair, By::Calibration)?;
        rectified.pair.doffs = calibration.doffs;
        rectified.pair.rig = Some(cameras.rig.in_original_frame(&by.rotations()[0]));
        rectified.notes = named(&self.names, by.doubts());
        rectified.notes.insert(0, format!("rectified by {}", self.names));
        Ok(Rectified { cameras: Some(cameras), ..rectified })
    }
}

#[wasm_bindgen]
impl StereoPair {
    /// Takes the cameras of a calibration of images that are rectified already, unless it is of images of another size.
    ///
    /// # Errors
    /// Where it lacks a value.
    #[wasm_bindgen(js_name = "takenBy")]
    pub fn taken_by(&mut self, known: &OfRectified) -> Thrown<()> {
        let (width, height) = self.pair.size();
        let is_other = |own: Option<u32>, size: usize| own.is_some_and(|own| own as usize != size);
        let other = is_other(known.width(), width) || is_other(known.height(), height);
        self.rig = if other { None } else { known.cameras()?.map(|cameras| cameras.rig) };
        Ok(())
    }
}

/// What a calibration says of images that are rectified already. Where they have another size than its own and the same aspect, it is
/// scaled to theirs.
#[wasm_bindgen]
pub struct OfRectified {
    calibration: Calibration,
    names: String,
}

#[wasm_bindgen]
impl OfRectified {
    /// The number of labels that it gives, from 0 on.
    #[wasm_bindgen(getter)]
    pub fn labels(&self) -> Option<u32> {
        self.calibration.ndisp
    }

    /// The width of the images that it is of, where it says so: another one than theirs where it has not their aspect.
    #[wasm_bindgen(getter)]
    pub fn width(&self) -> Option<u32> {
        self.calibration.width
    }

    /// The height of the images that it is of.
    #[wasm_bindgen(getter)]
    pub fn height(&self) -> Option<u32> {
        self.calibration.height
    }

    /// What is probably wrong with it for images of this width, and that it was scaled.
    #[must_use]
    pub fn doubts(&self, width: usize) -> Vec<String> {
        named(&self.names, &Doubt::about(&self.calibration, Some(width)))
    }

    /// The cameras; undefined where it says nothing of them, but the range alone.
    ///
    /// # Errors
    /// Where it lacks a value.
    pub fn cameras(&self) -> Thrown<Option<Cameras>> {
        let told = Some(&self.calibration).filter(|told| told.camera.is_some() || told.ndisp.is_none());
        told.map(Cameras::of).transpose()
    }
}

/// Doubts about the calibration of these files, each with their names.
fn named(names: &str, doubts: &[Doubt]) -> Vec<String> {
    doubts.iter().map(|cause| format!("{names}: {}", doubt(cause))).collect()
}

/// A pair that was rectified.
#[wasm_bindgen]
pub struct Rectified {
    pair: StereoPair,
    cameras: Option<Cameras>,
    notes: Vec<String>,
}

#[wasm_bindgen]
impl Rectified {
    /// Rectifies a pair by its own matches.
    ///
    /// # Errors
    /// If the matches do not determine a rectification.
    #[wasm_bindgen(js_name = "byMatches")]
    pub fn by_matches(pair: &StereoPair) -> Thrown<Rectified> {
        let by = Rectification::of_pair(&pair.pair, &Options::default()).map_err(thrown)?;
        let mut rectified = Self::new(&by, pair, By::Matches)?;
        if let Some(trust) = by.trust() {
            rectified.notes.insert(0, format!("rectified by its own matches, without a scale: {trust}"));
        }
        Ok(rectified)
    }

    /// What was done, and doubts about its accuracy.
    #[wasm_bindgen(getter)]
    pub fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    /// The cameras, if known. This moves them out.
    pub fn cameras(&mut self) -> Option<Cameras> {
        self.cameras.take()
    }

    /// The pair.
    #[must_use]
    pub fn pair(self) -> StereoPair {
        self.pair
    }
}

impl Rectified {
    fn new(by: &Rectification, pair: &StereoPair, what: By) -> Thrown<Self> {
        let rectified = by.apply(&pair.pair).map_err(thrown)?;
        let notes = by.doubts().iter().map(doubt).collect();
        Ok(Self { pair: StereoPair::of(rectified, Some(what)), cameras: None, notes })
    }
}
