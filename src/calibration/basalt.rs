//! Basalt's calibration in JSON: camera 0 is the left one, camera 1 the right one.

use super::cameras::{Pose, StereoCalibration};
use super::lens::{Distortion, Lens, RadialTangential};
use super::models::Model;
use super::node::{Entries, Entry};
use super::posed::{Posed, pair};
use crate::error::Result;
use crate::image::calib::Unit;

/// Whether the file is Basalt's.
pub(super) fn is(entries: &Entries) -> bool {
    let group = entries.find("value0").and_then(|entry| entry.group().ok());
    group.is_some_and(|group| group.find("timucam").is_some())
}

pub(super) fn read(entries: &Entries) -> Result<StereoCalibration> {
    let all = entries.require("value0", "value0", "the calibration")?.group()?;
    let both = |names: &str, called: &str| -> Result<[Entry; 2]> {
        let entry = all.require(names, called, "one for each of two cameras")?;
        let mut items = entry.items()?.into_iter();
        let pair = items.next().zip(items.next());
        pair.map(|(a, b)| [a, b]).ok_or_else(|| entry.wrong("one for each of two cameras"))
    };
    let poses = both("timucam", "T_imu_cam")?;
    let lenses = both("intrinsics", "intrinsics")?;
    let sizes = both("resolution", "resolution")?;
    let cameras = poses.into_iter().zip(lenses).zip(sizes).map(|((entry, lens), size)| {
        let pose = pose(&entry)?.inverse();
        Ok(Posed { lens: self::lens(&lens.group()?)?, size: Some(size.size()?), pose, entry })
    });
    let cameras: Vec<Posed> = cameras.collect::<Result<_>>()?;
    pair(&cameras[0], &cameras[1], Unit::Metre)
}

fn pose(entry: &Entry) -> Result<Pose> {
    let entries = entry.group()?;
    let number = |name: &str| entries.number(name, name);
    let translation = [number("px")?, number("py")?, number("pz")?];
    let rotation = entry.quaternion([number("qw")?, number("qx")?, number("qy")?, number("qz")?])?;
    Ok(Pose { rotation, translation })
}

fn lens(camera: &Entries) -> Result<Lens> {
    let expected = "pinhole, pinhole-radtan8, kb4, ds, eucm or ucm";
    let entry = camera.require("cameratype", "camera_type", expected)?;
    let numbers = camera.require("intrinsics", "intrinsics", "the numbers of the model")?.group()?;
    let number = |name: &str| numbers.number(name, name);
    let distortion = if entry.word()? == "ucm" {
        Distortion::ExtendedUnified { alpha: number("alpha")?, beta: 1.0 }
    } else {
        match Model::of(&entry).map_err(|_| entry.wrong(expected))? {
            Model::Pinhole => Distortion::NONE,
            Model::RadialTangential => {
                let [k1, k2, p1, p2] = [number("k1")?, number("k2")?, number("p1")?, number("p2")?];
                let all = [k1, k2, p1, p2, number("k3")?, number("k4")?, number("k5")?, number("k6")?];
                Distortion::RadialTangential(RadialTangential::polynomials(all))
            }
            Model::Equidistant => {
                Distortion::Equidistant([number("k1")?, number("k2")?, number("k3")?, number("k4")?])
            }
            Model::DoubleSphere => Distortion::DoubleSphere { xi: number("xi")?, alpha: number("alpha")? },
            Model::ExtendedUnified => {
                Distortion::ExtendedUnified { alpha: number("alpha")?, beta: number("beta")? }
            }
            _ => return Err(entry.wrong(expected)),
        }
    };
    let (focal_length, centre) = ([number("fx")?, number("fy")?], [number("cx")?, number("cy")?]);
    Lens::new(focal_length, centre, distortion)
        .map_err(|_| entry.error("has a focal length that is not above 0; calibrate again"))
}
