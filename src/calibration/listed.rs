//! Lists of cameras, the left one first: the settings of OKVIS, and the files of maplab and SVO.

use super::cameras::StereoCalibration;
use super::lens::{Distortion, Lens};
use super::models::Model;
use super::node::{Entries, Entry};
use super::opencv;
use super::posed::{Posed, pair};
use crate::error::Result;
use crate::image::calib::Unit;

// The pose from the camera to the body, of OKVIS and of maplab, and its inverse.
const POSES: &str = "tsc tbc";
const BACK: &str = "tcb";

/// Whether the file is such a list.
pub(super) fn is(entries: &Entries) -> bool {
    let items = entries.find("cameras").and_then(|entry| entry.items().ok());
    let first = items.and_then(|items| items.first().and_then(|item| item.group().ok()));
    first.is_some_and(|camera| camera.find(POSES).or_else(|| camera.find(BACK)).is_some())
}

pub(super) fn read(entries: &Entries) -> Result<StereoCalibration> {
    let list = entries.require("cameras", "cameras", "a list of cameras")?;
    let items = list.items()?;
    let [left, right, ..] = &items[..] else {
        return Err(list.error("has one camera; expected two, left and right"));
    };
    pair(&camera(left)?, &camera(right)?, Unit::Metre)
}

fn camera<'a>(item: &Entry<'a>) -> Result<Posed<'a>> {
    let entries = item.group()?;
    let (pose, entry) = if let Some(entry) = entries.find(BACK) {
        (entry.pose()?, entry)
    } else {
        let entry = entries.require(POSES, "T_SC", "a matrix of 4 x 4 from the camera to the body")?;
        (entry.pose()?.inverse(), entry)
    };
    let (lens, size) = match entries.find("camera") {
        Some(camera) => of_maplab(&camera.group()?)?,
        None => of_okvis(&entries)?,
    };
    Ok(Posed { lens, size: Some(size), pose, entry })
}

fn of_okvis(camera: &Entries) -> Result<(Lens, (usize, usize))> {
    let two = |names: &str, called: &str| {
        let entry = camera.require(names, called, "two numbers")?;
        entry.numbers::<2>("two numbers")
    };
    let (focal_length, centre) =
        (two("focallength", "focal_length")?, two("principalpoint", "principal_point")?);
    let model = camera.require("distortiontype", "distortion_type", "radialtangential or equidistant")?;
    let coefficients =
        camera.require("distortioncoefficients", "distortion_coefficients", "those of the lens")?;
    let size = camera.require("imagedimension", "image_dimension", "width and height")?.size()?;
    Ok((lens(focal_length, centre, &model, &coefficients)?, size))
}

fn of_maplab(camera: &Entries) -> Result<(Lens, (usize, usize))> {
    let expected = "4 numbers: fu, fv, cu, cv";
    let [fu, fv, cu, cv] = camera.require("intrinsics", "intrinsics", expected)?.numbers(expected)?;
    let distortion = camera.require("distortion", "distortion", "that of the lens")?.group()?;
    let model = distortion.require("type", "type", "radial-tangential or equidistant")?;
    let coefficients = distortion.require("parameters", "parameters", "those of the lens")?;
    let count = |names: &str, called: &str| camera.require(names, called, "a number of pixels")?.count();
    let size = (count("imagewidth", "image_width")?, count("imageheight", "image_height")?);
    Ok((lens([fu, fv], [cu, cv], &model, &coefficients)?, size))
}

fn lens(focal_length: [f64; 2], centre: [f64; 2], model: &Entry, coefficients: &Entry) -> Result<Lens> {
    let radial = || opencv::distortion(coefficients, "4 or 8 coefficients", false);
    let distortion = match (model.word()?, Model::of(model)) {
        // maplab's name for the field-of-view model.
        ("fisheye", _) => Distortion::FieldOfView(coefficients.number()?),
        ("radialtangential8", _) | (_, Ok(Model::RadialTangential)) => radial()?,
        (_, Ok(Model::Equidistant)) => opencv::distortion(coefficients, "4 coefficients", true)?,
        (_, Ok(Model::Pinhole)) => Distortion::NONE,
        _ => return Err(model.wrong("radial-tangential or equidistant")),
    };
    Lens::new(focal_length, centre, distortion)
        .map_err(|_| model.error("is of a camera whose focal length is not above 0"))
}
