//! VINS-Fusion's configuration with the files of its two cameras, which have the form of camodocal.

use super::cameras::StereoCalibration;
use super::lens::{Distortion, Lens, RadialTangential};
use super::models::Model;
use super::node::Entries;
use super::posed::{Posed, pair};
use crate::error::{Error, Result};
use crate::image::calib::Unit;

/// Whether these entries are those of one camera.
pub(super) fn is(entries: &Entries) -> bool {
    entries.find("modeltype").is_some() && entries.find("projectionparameters").is_some()
}

/// Whether these entries say how the cameras stand to the body.
pub(super) fn is_rig(entries: &Entries) -> bool {
    entries.find("bodytcam0").is_some()
}

/// The calibration of the cameras, left and right, in this rig.
pub(super) fn read(rig: &Entries, cameras: [&Entries; 2]) -> Result<StereoCalibration> {
    let camera = |i: usize| -> Result<Posed> {
        let called = ["body_T_cam0", "body_T_cam1"][i];
        let expected = "a matrix of 4 x 4 from the camera to the body";
        let entry = rig.require(["bodytcam0", "bodytcam1"][i], called, expected)?;
        let count =
            |names: &str, called: &str| cameras[i].require(names, called, "a number of pixels")?.count();
        let size = Some((count("imagewidth", "image_width")?, count("imageheight", "image_height")?));
        Ok(Posed { lens: lens(cameras[i])?, size, pose: entry.pose()?.inverse(), entry })
    };
    pair(&camera(0)?, &camera(1)?, Unit::Metre)
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
