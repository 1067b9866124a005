//! The settings of ORB-SLAM3, and those of ORB-SLAM2 for rectified pairs.

use super::cameras::{RectifiedViews, StereoCalibration};
use super::lens::{Distortion, Lens, RadialTangential};
use super::models::Model;
use super::node::Entries;
use super::opencv;
use super::posed::apart;
use crate::error::Result;
use crate::image::calib::{Camera, Unit};

/// Whether the file is such settings. Those of ORB-SLAM2 with lenses have OpenCV's matrices instead.
pub(super) fn is(entries: &Entries) -> bool {
    entries.find("camera1.fx camera.bf").is_some() && !opencv::has_lens(entries)
}

pub(super) fn read(entries: &Entries) -> Result<StereoCalibration> {
    let count = |names: &str, called: &str| entries.require(names, called, "a number of pixels")?.count();
    let size = Some((count("camera.width", "Camera.width")?, count("camera.height", "Camera.height")?));
    let mut calibration = StereoCalibration { size, unit: Unit::Metre, ..StereoCalibration::default() };
    if entries.find("camera1.fx").is_none() {
        let camera = camera(entries, "Camera")?;
        let baseline = entries.above_0("camera.bf", "Camera.bf")? / camera.focal_length[0];
        calibration.views = Some(RectifiedViews::of_rectified(camera, baseline));
        return Ok(calibration);
    }
    let entry = entries.require("camera.type", "Camera.type", "PinHole, KannalaBrandt8 or Rectified")?;
    if entry.word()?.eq_ignore_ascii_case("rectified") {
        let baseline = entries.above_0("stereo.b", "Stereo.b")?;
        calibration.views = Some(RectifiedViews::of_rectified(camera(entries, "Camera1")?, baseline));
        return Ok(calibration);
    }
    let fisheye = match Model::of(&entry) {
        Ok(Model::Equidistant) => true,
        Ok(Model::Pinhole) => false,
        _ => return Err(entry.wrong("PinHole, KannalaBrandt8 or Rectified")),
    };
    calibration.lenses = Some([lens(entries, "Camera1", fisheye)?, lens(entries, "Camera2", fisheye)?]);
    let entry = entries.require("stereo.tc1c2", "Stereo.T_c1_c2", "a matrix of 4 x 4 from camera 2 to 1")?;
    let pose = entry.pose()?.inverse();
    apart(&entry, &pose)?;
    calibration.pose = Some(pose);
    Ok(calibration)
}

/// Focal length and principal point of the camera of this name.
fn camera(entries: &Entries, name: &str) -> Result<Camera> {
    let names = |end: &str| (format!("{}.{end}", name.to_lowercase()), format!("{name}.{end}"));
    let number = |end: &str| {
        let (names, called) = names(end);
        entries.number(&names, &called)
    };
    let focal_length = |end: &str| {
        let (names, called) = names(end);
        entries.above_0(&names, &called)
    };
    Ok(Camera {
        focal_length: [focal_length("fx")?, focal_length("fy")?],
        principal_point: [number("cx")?, number("cy")?],
    })
}

fn lens(entries: &Entries, name: &str, fisheye: bool) -> Result<Lens> {
    let Camera { focal_length, principal_point } = camera(entries, name)?;
    let number =
        |end: &str| entries.number(&format!("{}.{end}", name.to_lowercase()), &format!("{name}.{end}"));
    let optional = |end: &str| entries.number_or_zero(&format!("{}.{end}", name.to_lowercase()));
    let distortion = if fisheye {
        Distortion::Equidistant([number("k1")?, number("k2")?, number("k3")?, number("k4")?])
    } else {
        let [k1, k2, k3] = [optional("k1")?, optional("k2")?, optional("k3")?];
        let all = [k1, k2, optional("p1")?, optional("p2")?, k3, 0.0, 0.0, 0.0];
        Distortion::RadialTangential(RadialTangential::polynomials(all))
    };
    let entry = entries.require(&format!("{}.fx", name.to_lowercase()), name, "a number above 0")?;
    Lens::new(focal_length, principal_point, distortion).map_err(|_| entry.wrong("a number above 0"))
}
