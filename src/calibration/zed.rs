//! The calibration file of ZED cameras, which has the lenses at each of their sizes.

use super::cameras::{Pose, StereoCalibration};
use super::lens::{Distortion, Lens, RadialTangential};
use super::matrix::rotation;
use super::node::Entries;
use super::posed::apart;
use crate::error::{Error, Result};
use crate::image::calib::Unit;

/// Names of sizes.
const SIZES: [(&str, (usize, usize)); 6] = [
    ("2k", (2208, 1242)),
    ("fhd", (1920, 1080)),
    ("fhd1200", (1920, 1200)),
    ("hd", (1280, 720)),
    ("svga", (960, 600)),
    ("vga", (672, 376)),
];

/// Whether these entries are such a file's.
pub(super) fn is(entries: &Entries) -> bool {
    entries.find("stereo").is_some()
        && SIZES.iter().any(|(name, _)| entries.find(&section("left", name)).is_some())
}

fn section(side: &str, size: &str) -> String {
    format!("{side}cam{size}")
}

pub(super) fn read(entries: &Entries) -> Result<StereoCalibration> {
    let there = SIZES.iter().filter(|(name, _)| entries.find(&section("left", name)).is_some());
    let sizes = there.map(|(name, size)| of_size(entries, name, *size)).collect::<Result<Vec<_>>>()?;
    StereoCalibration::of_sizes(sizes)
        .ok_or_else(|| Error::read(entries.path(), "has no size of images that is known"))
}

/// The calibration for images of `size`, which sections call `name`.
fn of_size(entries: &Entries, name: &str, size: (usize, usize)) -> Result<StereoCalibration> {
    let lens = |side: &str| {
        let called = format!("{}_CAM_{}", side.to_uppercase(), name.to_uppercase());
        let entry = entries.require(&section(side, name), &called, "the numbers of a lens")?;
        let numbers = entry.group()?;
        let number = |name: &str| numbers.number(name, name);
        let k = |name: &str| numbers.number_or_zero(name);
        let all = [k("k1")?, k("k2")?, k("p1")?, k("p2")?, k("k3")?, k("k4")?, k("k5")?, k("k6")?];
        if numbers.find("p1").is_none() && numbers.find("k4").is_some() {
            return Err(entry.error(
                "k4 without p1 is of a fisheye, which is not read; give an OpenCV file with fisheye: 1",
            ));
        }
        let distortion = Distortion::RadialTangential(RadialTangential::polynomials(all));
        let wrong = |_| entry.error("has a focal length that is not above 0; calibrate again");
        Lens::new([number("fx")?, number("fy")?], [number("cx")?, number("cy")?], distortion).map_err(wrong)
    };
    let entry = entries.require("stereo", "STEREO", "how the cameras stand")?;
    let stereo = entry.group()?;
    let of_this = |stem: &str| {
        stereo.number(&format!("{stem}{name}"), &format!("{}_{}", stem.to_uppercase(), name.to_uppercase()))
    };
    // Older files have one for all sizes.
    let moved = |stem: &str| stereo.number_or_zero(&format!("{stem}{name} {stem}"));
    let turn = [of_this("rx")?, of_this("cv")?, of_this("rz")?];
    // The vector from the left to the right camera, which stereoRectify takes with either sign.
    let translation = [-stereo.number("baseline", "Baseline")?, -moved("ty")?, -moved("tz")?];
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
