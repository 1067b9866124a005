//! mrcal's `.cameramodel`, one file for each camera, the left one first.

use super::cameras::{Pose, StereoCalibration};
use super::lens::{Distortion, Lens, RadialTangential};
use super::matrix::rotation;
use super::node::{Entries, Node};
use super::posed::{Posed, pair};
use super::syntax;
use crate::error::Result;
use crate::image::calib::Unit;

const MODEL: &str = "lensmodel distortionmodel";
const POSE: &str = "extrinsics rtcamref";

/// The entries of such a file, a Python dictionary; `None` for any other file. The error is one line.
pub(super) fn parse(text: &str) -> Option<Result<Node, String>> {
    let first = text.lines().find(|line| !line.trim().is_empty() && !line.starts_with('#'))?;
    let is = first.trim_start().starts_with('{') && text.contains("LENSMODEL_");
    // Make YAML of byte strings and of lists in parentheses.
    is.then(|| syntax::yaml(&text.replace("b'", "'").replace('(', "[").replace(')', "]")))
}

/// Whether the file is of one camera.
pub(super) fn is(entries: &Entries) -> bool {
    let model = entries.find(MODEL).and_then(|entry| entry.word().ok());
    model.is_some_and(|model| model.starts_with("LENSMODEL_"))
}

pub(super) fn read(cameras: [&Entries; 2]) -> Result<StereoCalibration> {
    let [left, right] = cameras.map(camera);
    // The unit is that of the calibration board.
    pair(&left?, &right?, Unit::Unknown)
}

fn camera<'a>(entries: &Entries<'a>) -> Result<Posed<'a>> {
    let model = entries.require(MODEL, "lensmodel", "the lens model")?;
    let expected = "fx, fy, cx, cy, and the coefficients of the lens model";
    let entry = entries.require("intrinsics", "intrinsics", expected)?;
    let count = match model.word()? {
        "LENSMODEL_PINHOLE" => 0,
        "LENSMODEL_OPENCV4" => 4,
        "LENSMODEL_OPENCV5" => 5,
        "LENSMODEL_OPENCV8" => 8,
        "LENSMODEL_OPENCV12" => 12,
        _ => {
            let reason = "LENSMODEL_PINHOLE, or LENSMODEL_OPENCV4 to 12; mrcal-convert-lensmodel makes such a model of another";
            return Err(model.wrong(reason));
        }
    };
    let numbers = entry.list(expected)?;
    let (&[fx, fy, cx, cy], coefficients) = numbers
        .split_first_chunk()
        .filter(|(_, rest)| rest.len() == count)
        .ok_or_else(|| entry.wrong(expected))?;
    let distortion = RadialTangential::new(coefficients).map_err(|expected| entry.wrong(expected))?;
    let lens = Lens::new([fx, fy], [cx, cy], Distortion::RadialTangential(distortion))
        .map_err(|_| entry.wrong(expected))?;
    let size = entries.require("imagersize", "imagersize", "width and height")?.size()?;
    let expected = "6 numbers, from the reference to the camera: a rotation vector and a translation";
    let entry = entries.require(POSE, "extrinsics", expected)?;
    let [a, b, c, x, y, z] = entry.numbers(expected)?;
    let pose = Pose { rotation: rotation([a, b, c]), translation: [x, y, z] };
    Ok(Posed { lens, size: Some(size), pose, entry })
}
