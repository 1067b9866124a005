//! The calibration in the memory of OAK cameras, as DepthAI writes it in JSON.

use super::cameras::{Pose, StereoCalibration};
use super::lens::{Distortion, Lens};
use super::node::{Entries, Entry};
use super::opencv;
use super::posed::{Posed, pair};
use crate::error::Result;
use crate::image::calib::Unit;

/// Whether these entries are DepthAI's.
pub(super) fn is(entries: &Entries) -> bool {
    entries.find("cameradata").is_some() && entries.find("stereorectificationdata").is_some()
}

pub(super) fn read(entries: &Entries) -> Result<StereoCalibration> {
    let expected = "the sockets of the left and the right camera";
    let stereo = entries.require("stereorectificationdata", "stereoRectificationData", expected)?;
    let sockets = stereo.group()?;
    let left = sockets.number("leftcamerasocket", "leftCameraSocket")? as i64;
    let right = sockets.number("rightcamerasocket", "rightCameraSocket")? as i64;
    let cameras = entries.require("cameradata", "cameraData", "a list of cameras")?;
    // Extrinsics lead along a chain of cameras, so one of both ways is there.
    let poses = match (chain(&cameras, left, right)?, chain(&cameras, right, left)?) {
        (Some(pose), _) => [Pose::IN_PLACE, pose],
        (None, Some(pose)) => [pose, Pose::IN_PLACE],
        _ => return Err(stereo.error("has cameras between which no extrinsics lead; calibrate again")),
    };
    let left = posed(camera(&cameras, left)?, poses[0])?;
    let right = posed(camera(&cameras, right)?, poses[1])?;
    pair(&left, &right, Unit::Centimetre)
}

/// The camera of a socket: cameras are pairs of a socket and what is known.
fn camera<'a>(cameras: &Entry<'a>, socket: i64) -> Result<Entry<'a>> {
    for item in cameras.items()? {
        let mut parts = item.items()?.into_iter();
        if let (Some(number), Some(camera)) = (parts.next(), parts.next())
            && number.number()? as i64 == socket
        {
            return Ok(camera);
        }
    }
    Err(cameras.error(format_args!("has no camera at socket {socket}; it is to be one of the pair")))
}

/// From the camera at `from` to that at `to`, where extrinsics lead there.
fn chain(cameras: &Entry, from: i64, to: i64) -> Result<Option<Pose>> {
    let (mut socket, mut pose) = (from, Pose::IN_PLACE);
    for _ in 0..cameras.items()?.len() {
        let extrinsics = camera(cameras, socket)?
            .group()?
            .require("extrinsics", "extrinsics", "those of the camera")?
            .group()?;
        let next = extrinsics.number("tocamerasocket", "toCameraSocket")? as i64;
        if next < 0 {
            break;
        }
        let entry = extrinsics.require("rotationmatrix", "rotationMatrix", "a rotation of 3 x 3")?;
        let rotation = entry.rotation(&entry.matrix()?)?;
        let moved = extrinsics.require("translation", "translation", "x, y and z")?.group()?;
        let translation = [moved.number("x", "x")?, moved.number("y", "y")?, moved.number("z", "z")?];
        pose = Pose::between(&pose.inverse(), &Pose { rotation, translation });
        if next == to {
            return Ok(Some(pose));
        }
        socket = next;
    }
    Ok(None)
}

fn posed(camera: Entry, pose: Pose) -> Result<Posed> {
    let entries = camera.group()?;
    let count = |names: &str| entries.require(names, names, "a number of pixels")?.count();
    let size = Some((count("width")?, count("height")?));
    let matrix = entries.require("intrinsicmatrix", "intrinsicMatrix", "a matrix of 3 x 3")?;
    let (focal_length, principal_point) = opencv::camera(&matrix)?;
    let expected = "the coefficients of the lens";
    let entry = entries.require("distortioncoeff", "distortionCoeff", expected)?;
    let kind = entries.require("cameratype", "cameraType", "0 (perspective) or 1 (fisheye)")?;
    let distortion = match kind.number()? {
        0.0 => opencv::distortion(&entry, expected, false)?,
        // Those that a fisheye has not are 0.
        1.0 => match entry.list(expected)?[..] {
            [k1, k2, k3, k4, ..] => Distortion::Equidistant([k1, k2, k3, k4]),
            _ => return Err(entry.wrong("the 4 coefficients of a fisheye, and others that do not count")),
        },
        _ => return Err(kind.wrong("0 (perspective) or 1 (fisheye)")),
    };
    let lens = Lens::new(focal_length, principal_point, distortion)
        .map_err(|_| matrix.wrong("a camera with its lens"))?;
    Ok(Posed { lens, size, pose, entry: camera })
}
