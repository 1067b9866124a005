//! Kalibr's camera chain: cam0 is the left camera, cam1 the right one.

use super::cameras::{Pose, StereoCalibration};
use super::lens::{Distortion, Lens};
use super::matrix::length;
use super::node::Entries;
use super::opencv;
use crate::error::{Error, Result};
use crate::image::calib::Unit;

/// Whether these entries are a chain of cameras.
pub(super) fn is(entries: &Entries) -> bool {
    entries.find("cam0").is_some()
}

pub(super) fn read(entries: &Entries) -> Result<StereoCalibration> {
    let camera = |name: &str| entries.require(name, name, "a camera of the chain")?.group();
    let (left, right) = (camera("cam0")?, camera("cam1")?);
    let (lenses, sizes) = ([lens(&left)?, lens(&right)?], [size(&left)?, size(&right)?]);
    if sizes[0] != sizes[1] {
        let reason = format!(
            "cam1.resolution: expected {} x {} as cam0 has, found {} x {}",
            sizes[0].0, sizes[0].1, sizes[1].0, sizes[1].1
        );
        return Err(Error::read(entries.path(), reason));
    }
    let entry = right.require("tcncnm1", "T_cn_cnm1", "a matrix of 4 x 4 from cam0 to cam1")?;
    let wrong = || entry.wrong("a rotation and a translation other than 0, and 0 0 0 1 in the last row");
    let [a, b, c, [0.0, 0.0, 0.0, 1.0]] = entry.matrix::<4, 4>()? else { return Err(wrong()) };
    let translation = [a[3], b[3], c[3]];
    if length(translation) == 0.0 {
        return Err(wrong());
    }
    let rotation = entry.rotation(&[a, b, c].map(|row| [row[0], row[1], row[2]]))?;
    Ok(StereoCalibration {
        lenses: Some(lenses),
        pose: Some(Pose { rotation, translation }),
        size: Some(sizes[0]),
        unit: Unit::Metre,
        ..StereoCalibration::default()
    })
}

fn size(camera: &Entries) -> Result<(usize, usize)> {
    camera.require("resolution", "resolution", "width and height")?.size()
}

fn lens(camera: &Entries) -> Result<Lens> {
    const INTRINSICS: &str = "4 numbers: fu, fv, pu, pv, with fu and fv above 0";
    if let Some(model) = camera.find("cameramodel")
        && model.word()? != "pinhole"
    {
        return Err(model.wrong("pinhole"));
    }
    let entry = camera.require("intrinsics", "intrinsics", INTRINSICS)?;
    let [fu, fv, pu, pv] = entry.numbers(INTRINSICS)?;
    let expected = "radtan, equidistant or none";
    let model = camera.require("distortionmodel", "distortion_model", expected)?;
    let distortion = match model.word()? {
        word @ ("radtan" | "equidistant") => {
            let entry = camera.require("distortioncoeffs", "distortion_coeffs", "4 coefficients")?;
            opencv::distortion(&entry, "4 coefficients", word == "equidistant")?
        }
        "none" => Distortion::NONE,
        _ => return Err(model.wrong(expected)),
    };
    Lens::new([fu, fv], [pu, pv], distortion).map_err(|_| entry.wrong(INTRINSICS))
}
