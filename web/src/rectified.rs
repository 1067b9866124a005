//! Calibrations, and pairs rectified by a calibration or by their own matches.

use crate::Thrown;
use crate::pair::{Cameras, StereoPair};
use crate::words::{By, doubt, thrown};
use mrfgs::calibration::{self, cameras::StereoCalibration};
use mrfgs::rectification::{Options, Rectification};
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

    /// The number of labels that it gives, from 0 on.
    #[wasm_bindgen(getter)]
    pub fn labels(&self) -> Option<u32> {
        self.known.benchmark.as_ref()?.ndisp
    }

    /// The width of its images, where it says so.
    #[wasm_bindgen(getter)]
    pub fn width(&self) -> Option<usize> {
        Some(self.known.size?.0)
    }

    /// Their height.
    #[wasm_bindgen(getter)]
    pub fn height(&self) -> Option<usize> {
        Some(self.known.size?.1)
    }

    /// The cameras of images that are rectified already; undefined where it says nothing of them.
    ///
    /// # Errors
    /// Where it lacks a value.
    pub fn cameras(&self, width: usize, height: usize) -> Thrown<Option<Cameras>> {
        let calibration = self.known.of_rectified_images(Some((width, height))).map_err(thrown)?;
        // Some have the range alone.
        let told = calibration.filter(|told| told.camera.is_some() || told.ndisp.is_none());
        told.map(|told| Cameras::of(&told)).transpose()
    }

    /// Rectifies a pair.
    ///
    /// # Errors
    /// If the calibration is incomplete, or for images of another size.
    pub fn rectify(&self, pair: &StereoPair) -> Thrown<Rectified> {
        let by = Rectification::for_pair(&self.known, &pair.pair, &Options::default()).map_err(thrown)?;
        let calibration = by.calibration().map_err(thrown)?;
        let cameras = Cameras::of(&calibration)?;
        let mut rectified = Rectified::new(&by, pair, By::Calibration)?;
        rectified.pair.doffs = calibration.doffs;
        rectified.notes.insert(0, format!("rectified by {}", self.names));
        Ok(Rectified { cameras: Some(cameras), ..rectified })
    }
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
        Ok(Self { pair: StereoPair { pair: rectified, by: Some(what), doffs: None }, cameras: None, notes })
    }
}
