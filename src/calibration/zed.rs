//! The calibration file of ZED cameras, with the lenses at each image size.

use super::cameras::{Pose, StereoCalibration};
use super::lens::{Distortion, Lens, RadialTangential};
use super::matrix::rotation;
use super::node::Entries;
use super::posed::apart;
use crate::error::{Error, Result};
use crate::image::calib::Unit;

/// The names of the image sizes.
const SIZES: [(&str, (usize, usize)); 8] = [
    ("4k", (3840, 2160)),
    ("qhdplus", (3200, 1800)),
    ("2k", (2208, 1242)),
    ("fhd", (1920, 1080)),
    ("fhd1200", (1920, 1200)),
    ("hd", (1280, 720)),
    ("svga", (960, 600)),
    ("vga", (672, 376)),
];

/// Whether the file is of a ZED camera, of two lenses or of one.
pub(super) fn is(entries: &Entries) -> bool {
    let lens = |name: &str| ["leftcam", "rightcam", "cam"].iter().any(|stem| name.starts_with(stem));
    let stereo = entries.find("stereo").and_then(|entry| entry.group().ok());
    match stereo {
        Some(stereo) => stereo.find("baseline").is_some(),
        None => {
            entries.find("leftdisto rightdisto disto").is_some() && entries.names().any(|name| lens(&name))
        }
    }
}

fn section(side: &str, size: &str) -> String {
    format!("{side}cam{size}")
}

pub(super) fn read(entries: &Entries) -> Result<StereoCalibration> {
    let there = SIZES.iter().filter(|(name, _)| entries.find(&section("left", name)).is_some());
    let sizes = there.map(|(name, size)| of_size(entries, name, *size)).collect::<Result<Vec<_>>>()?;
    let known = || SIZES.map(|(name, _)| name.to_uppercase()).join(", ");
    StereoCalibration::of_sizes(sizes).ok_or_else(|| {
        let reason = format!(
            "has no lenses of a pair: expected LEFT_CAM_ and RIGHT_CAM_ followed by {}; give the file of both cameras",
            known()
        );
        Error::read(entries.path(), reason)
    })
}

/// The calibration for images of `size`, whose sections are called `name`.
fn of_size(entries: &Entries, name: &str, size: (usize, usize)) -> Result<StereoCalibration> {
    let lens = |side: &str| {
        let called = format!("{}_CAM_{}", side.to_uppercase(), name.to_uppercase());
        let entry = entries.require(&section(side, name), &called, "the numbers of a lens")?;
        let numbers = entry.group()?;
        let number = |name: &str| numbers.number(name, name);
        // Newer files have one model for all sizes. It takes precedence over an older one.
        let of_all = entries.find(&format!("{side}disto")).map(|entry| entry.group()).transpose()?;
        let distortion = distortion(of_all.as_ref().unwrap_or(&numbers))?;
        let wrong = |_| entry.error("has a focal length that is not above 0; calibrate again");
        Lens::new([number("fx")?, number("fy")?], [number("cx")?, number("cy")?], distortion).map_err(wrong)
    };
    let entry = entries.require("stereo", "STEREO", "how the cameras stand")?;
    let stereo = entry.group()?;
    let of_this = |stem: &str| {
        stereo.number(&format!("{stem}{name}"), &format!("{}_{}", stem.to_uppercase(), name.to_uppercase()))
    };
    // Some files have one value for all sizes.
    let moved = |stem: &str| stereo.number_or_zero(&format!("{stem}{name} {stem}"));
    let turn = [of_this("rx")?, of_this("cv")?, of_this("rz")?];
    // Stereolabs' calibration tools write OpenCV's T like this: the first number negated, the others as they are.
    let translation = [-stereo.number("baseline", "Baseline")?, moved("ty")?, moved("tz")?];
    let pose = Pose { rotation: rotation(turn), translation };
    apart(&entry, &pose)?;
    Ok(StereoCalibration {
        lenses: Some([lens("left")?, lens("right")?]),
        pose: Some(pose),
        size: Some(size),
        unit: Unit::Millimetre,
        ..StereoCalibration::default()
    })
}

/// The distortion in a section. Fisheyes have k1 to k4, and all other coefficients are 0.
fn distortion(section: &Entries) -> Result<Distortion> {
    let c = |name: &str| section.number_or_zero(name);
    let [k1, k2, k3, k4] = [c("k1")?, c("k2")?, c("k3")?, c("k4")?];
    let others = [c("p1")?, c("p2")?, c("k5")?, c("k6")?];
    if k4 != 0.0 && others.iter().all(|v| *v == 0.0) {
        return Ok(Distortion::Equidistant([k1, k2, k3, k4]));
    }
    let [p1, p2, k5, k6] = others;
    Ok(Distortion::RadialTangential(RadialTangential::polynomials([k1, k2, p1, p2, k3, k4, k5, k6])))
}
