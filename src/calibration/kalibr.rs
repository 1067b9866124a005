//! Kalibr's camera chain: cam0 is the left camera, cam1 the right one.

use super::cameras::{Pose, StereoCalibration, ThirdCamera};
use super::lens::{Distortion, Lens, RadialTangential};
use super::matrix::{degrees, length, product, transposed};
use super::models::Model;
use super::node::{Entries, Entry};
use super::opencv;
use super::posed::apart;
use crate::error::{Error, Result};
use crate::image::calib::Unit;

/// Whether the file is a chain of cameras.
pub(super) fn is(entries: &Entries) -> bool {
    entries.find("cam0").is_some_and(|entry| entry.group().is_ok())
}

pub(super) fn read(entries: &Entries) -> Result<StereoCalibration> {
    let camera = |name: &str| entries.require(name, name, "a camera of the chain")?.group();
    let (left, right) = (camera("cam0")?, camera("cam1")?);
    let (lenses, sizes) = ([lens(&left)?, lens(&right)?], [size(&left)?, size(&right)?]);
    let (entry, pose) = step(&left, &right, 1)?;
    apart(&entry, &pose)?;
    Ok(StereoCalibration {
        lenses: Some(lenses),
        pose: Some(pose),
        size: Some(sizes[0]),
        right_size: Some(sizes[1]).filter(|right| *right != sizes[0]),
        unit: Unit::Metre,
        ..StereoCalibration::default()
    })
}

/// The pose of camera `n` of the chain relative to the one before it, and the entry of the pose.
fn step<'a>(from: &Entries<'a>, to: &Entries<'a>, n: usize) -> Result<(Entry<'a>, Pose)> {
    // Smaller differences come from rounding.
    const DEGREES: f64 = 0.1;
    const PART: f64 = 0.01;
    let stated = to.find("tcncnm1").map(|entry| Ok::<_, Error>((entry.pose()?, entry))).transpose()?;
    let in_body = body(from)?.zip(body(to)?);
    let by_body = in_body.map(|((from, _), (to, entry))| (Pose::between(&from, &to), entry));
    match (stated, by_body) {
        (Some((pose, entry)), None) | (None, Some((pose, entry))) => Ok((entry, pose)),
        (Some((pose, entry)), Some((other, by))) => {
            let turn = degrees(&product(&other.rotation, &transposed(&pose.rotation)));
            let moved = length(std::array::from_fn(|i| other.translation[i] - pose.translation[i]));
            if turn <= DEGREES && moved <= PART * length(pose.translation) {
                return Ok((entry, pose));
            }
            Err(entry.error(format_args!(
                "contradicts {} of both cameras by {turn:.2} degrees and {moved:.4} m; keep what is right",
                by.name().rsplit('.').next().unwrap_or_default()
            )))
        }
        (None, None) => {
            let expected =
                format!("a matrix of 4 x 4 from cam{} to cam{n}, or T_cam_imu in both cameras", n - 1);
            let entry = to.require("tcncnm1", "T_cn_cnm1", &expected)?;
            let pose = entry.pose()?;
            Ok((entry, pose))
        }
    }
}

/// The pose of a camera relative to the inertial sensor.
fn body<'a>(camera: &Entries<'a>) -> Result<Option<(Pose, Entry<'a>)>> {
    if let Some(entry) = camera.find("tcamimu") {
        return Ok(Some((entry.pose()?, entry)));
    }
    camera.find("timucam").map(|entry| Ok((entry.pose()?.inverse(), entry))).transpose()
}

/// The last camera of the chain, relative to the left one.
pub(super) fn last(entries: &Entries) -> Result<ThirdCamera> {
    let mut last = 1;
    while entries.find(&format!("cam{}", last + 1)).is_some() {
        last += 1;
    }
    let camera = |n: usize| {
        let name = format!("cam{n}");
        entries.require(&name, &name, "a camera of the chain beside the left one")?.group()
    };
    let mut pose = Pose::IN_PLACE;
    for n in 1..=last {
        let from = entries.require(&format!("cam{}", n - 1), "", "the camera before it")?.group()?;
        pose = pose.then(&step(&from, &camera(n)?, n)?.1);
    }
    let camera = camera(last)?;
    Ok(ThirdCamera { lens: lens(&camera)?, pose, size: size(&camera)?, unit: Unit::Metre })
}

/// The image size of a camera, in the form that EuRoC shares.
pub(super) fn size(camera: &Entries) -> Result<(usize, usize)> {
    camera.require("resolution", "resolution", "width and height")?.size()
}

/// The lens of a camera, in the form that EuRoC shares.
pub(super) fn lens(camera: &Entries) -> Result<Lens> {
    let (model, names) = match camera.find("cameramodel").map(|entry| (Model::of(&entry), entry)) {
        None => (Model::Pinhole, ""),
        Some((model, entry)) => match model? {
            model @ Model::Pinhole => (model, ""),
            model @ Model::Unified => (model, "xi, "),
            model @ Model::DoubleSphere => (model, "xi, alpha, "),
            model @ Model::ExtendedUnified => (model, "alpha, beta, "),
            _ => return Err(entry.wrong("pinhole, omni, ds or eucm")),
        },
    };
    let own = names.matches(',').count();
    let expected = format!("{} numbers: {names}fu, fv, pu, pv, with fu and fv above 0", own + 4);
    let entry = camera.require("intrinsics", "intrinsics", &expected)?;
    let numbers = entry.list(&expected)?;
    let Some((own, &[fu, fv, pu, pv])) = numbers.split_at_checked(own) else {
        return Err(entry.wrong(&expected));
    };
    let distortion = distortion(camera, model, own)?;
    Lens::new([fu, fv], [pu, pv], distortion).map_err(|_| entry.wrong(&expected))
}

/// The distortion of a lens of this model, whose `own` parameters precede the focal length.
fn distortion(camera: &Entries, model: Model, own: &[f64]) -> Result<Distortion> {
    let expected = match model {
        Model::Pinhole => "radtan, equidistant, fov or none",
        Model::Unified => "radtan or none, which go with omni",
        _ => "none, which goes with this camera_model",
    };
    let entry = camera.require("distortionmodel", "distortion_model", expected)?;
    let coefficients =
        || camera.require("distortioncoeffs distortioncoefficients", "distortion_coeffs", "the coefficients");
    let radial = || opencv::radial_tangential(&coefficients()?, "4 coefficients");
    // The name "none" reads as a pinhole.
    match (model, Model::of(&entry).map_err(|_| entry.wrong(expected))?, own) {
        (Model::Pinhole, Model::RadialTangential, _) => radial().map(Distortion::RadialTangential),
        (Model::Pinhole, Model::Equidistant, _) => {
            opencv::distortion(&coefficients()?, "4 coefficients", true)
        }
        (Model::Pinhole, Model::FieldOfView, _) => {
            let entry = coefficients()?;
            let [w] = entry.numbers("1 coefficient, the field of view in radians")?;
            Ok(Distortion::FieldOfView(w))
        }
        (Model::Pinhole, Model::Pinhole, _) => Ok(Distortion::NONE),
        (Model::Unified, Model::RadialTangential, &[xi]) => Ok(Distortion::Unified { xi, then: radial()? }),
        (Model::Unified, Model::Pinhole, &[xi]) => {
            Ok(Distortion::Unified { xi, then: RadialTangential::NONE })
        }
        (Model::DoubleSphere, Model::Pinhole, &[xi, alpha]) => Ok(Distortion::DoubleSphere { xi, alpha }),
        (Model::ExtendedUnified, Model::Pinhole, &[alpha, beta]) => {
            Ok(Distortion::ExtendedUnified { alpha, beta })
        }
        _ => Err(entry.wrong(expected)),
    }
}
