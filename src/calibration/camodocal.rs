//! Camodocal's files of two cameras, with its own file of their pose or with VINS-Fusion's configuration.

use super::cameras::{Pose, StereoCalibration};
use super::lens::{Distortion, Lens, RadialTangential};
use super::models::Model;
use super::node::{Entries, Entry};
use super::posed::{Posed, pair};
use crate::error::{Error, Result};
use crate::image::calib::Unit;

/// Whether the file is of one camera.
pub(super) fn is(entries: &Entries) -> bool {
    entries.find("modeltype").is_some() && entries.find("projectionparameters").is_some()
}

/// Whether the file has the pose of the cameras.
pub(super) fn is_rig(entries: &Entries) -> bool {
    entries.find("bodytcam0").is_some() || is_own(entries)
}

/// Whether the pose is in camodocal's own form.
fn is_own(entries: &Entries) -> bool {
    let group = entries.find("transform").and_then(|entry| entry.group().ok());
    group.is_some_and(|group| group.find("qw").is_some())
}

/// The calibration of the left and right `cameras` in this `rig`.
pub(super) fn read(rig: &Entries, cameras: [&Entries; 2]) -> Result<StereoCalibration> {
    let posed = |camera: &Entries, pose: Pose, entry| -> Result<Posed> {
        let count = |names: &str, called: &str| camera.require(names, called, "a number of pixels")?.count();
        let size = Some((count("imagewidth", "image_width")?, count("imageheight", "image_height")?));
        Ok(Posed { lens: lens(camera)?, size, pose, entry })
    };
    let [left, right] = cameras;
    if is_own(rig) {
        let entry = || rig.require("transform", "transform", "a rotation and a translation");
        let pose = transform(&entry()?)?;
        // The unit is that of the calibration board.
        return pair(&posed(left, Pose::IN_PLACE, entry()?)?, &posed(right, pose, entry()?)?, Unit::Unknown);
    }
    let in_body = |camera: &Entries, names: &str, called: &str| {
        let entry = rig.require(names, called, "a matrix of 4 x 4 from the camera to the body")?;
        posed(camera, entry.pose()?.inverse(), entry)
    };
    let left = in_body(left, "bodytcam0", "body_T_cam0")?;
    let right = in_body(right, "bodytcam1", "body_T_cam1")?;
    pair(&left, &right, Unit::Metre)
}

/// The pose of the right camera relative to the left one.
fn transform(entry: &Entry) -> Result<Pose> {
    let entries = entry.group()?;
    let number = |names: &str, called: &str| entries.number(names, called);
    let [x, y, z] = [number("qx", "q_x")?, number("qy", "q_y")?, number("qz", "q_z")?];
    let rotation = entry.quaternion([number("qw", "q_w")?, x, y, z])?;
    let translation = [number("tx", "t_x")?, number("ty", "t_y")?, number("tz", "t_z")?];
    Ok(Pose { rotation, translation })
}

fn lens(camera: &Entries) -> Result<Lens> {
    let group = |names: &str, called: &str| camera.require(names, called, "a group of numbers")?.group();
    let projection = group("projectionparameters", "projection_parameters")?;
    let radial = || {
        let entries = group("distortionparameters", "distortion_parameters")?;
        let c = |name: &str| entries.number_or_zero(name);
        let all = [c("k1")?, c("k2")?, c("p1")?, c("p2")?, c("k3")?, c("k4")?, c("k5")?, c("k6")?];
        Ok::<_, Error>(RadialTangential::polynomials(all))
    };
    let entry = camera.require("modeltype", "model_type", "PINHOLE, MEI or KANNALA_BRANDT")?;
    let (distortion, names) = match Model::of(&entry) {
        Ok(Model::Pinhole | Model::RadialTangential) => {
            (Distortion::RadialTangential(radial()?), ["fx", "fy", "cx", "cy"])
        }
        Ok(Model::Unified) => {
            let xi = group("mirrorparameters", "mirror_parameters")?.number("xi", "xi")?;
            (Distortion::Unified { xi, then: radial()? }, ["gamma1", "gamma2", "u0", "v0"])
        }
        Ok(Model::Equidistant) => {
            let k = |name: &str| projection.number(name, name);
            (Distortion::Equidistant([k("k2")?, k("k3")?, k("k4")?, k("k5")?]), ["mu", "mv", "u0", "v0"])
        }
        _ => return Err(entry.wrong("PINHOLE, MEI or KANNALA_BRANDT")),
    };
    let [fx, fy, cx, cy] = names.map(|name| projection.number(name, name));
    let wrong = |_| entry.error("has a focal length that is not above 0; calibrate again");
    Lens::new([fx?, fy?], [cx?, cy?], distortion).map_err(wrong)
}
