//! The calibration in the memory of OAK cameras, as DepthAI writes it in JSON.

use super::cameras::{Pose, StereoCalibration, ThirdCamera};
use super::lens::{Distortion, Lens};
use super::node::{Entries, Entry};
use super::opencv;
use super::posed::{Posed, pair};
use crate::error::Result;
use crate::image::calib::Unit;

/// Whether the file is DepthAI's.
pub(super) fn is(entries: &Entries) -> bool {
    entries.find("cameradata").is_some() && entries.find("stereorectificationdata").is_some()
}

pub(super) fn read(entries: &Entries) -> Result<StereoCalibration> {
    let sockets = Sockets::read(entries)?;
    let left = posed(camera(&sockets.cameras, sockets.left)?, Pose::IN_PLACE)?;
    let right = posed(camera(&sockets.cameras, sockets.right)?, sockets.pose_of(sockets.right)?)?;
    // OAK cameras crop images of another aspect ratio.
    Ok(StereoCalibration { fills: true, ..pair(&left, &right, Unit::Centimetre)? })
}

/// The camera beside the pair, usually the colour camera.
pub(super) fn third(entries: &Entries) -> Result<ThirdCamera> {
    let sockets = Sockets::read(entries)?;
    let mut others = Vec::new();
    for item in sockets.cameras.items()? {
        let socket = item.items()?.first().map(Entry::number).transpose()?;
        others.extend(
            socket.map(|socket| socket as i64).filter(|s| ![sockets.left, sockets.right].contains(s)),
        );
    }
    let [socket] = others[..] else {
        return Err(sockets.cameras.error(format_args!(
            "has {} cameras beside the pair; expected one, or K, D, R, T and image_size of the one you mean",
            others.len()
        )));
    };
    let third = posed(camera(&sockets.cameras, socket)?, sockets.pose_of(socket)?)?;
    let size = third.size.ok_or_else(|| third.entry.error("does not say the size of its images"))?;
    Ok(ThirdCamera { lens: third.lens, pose: third.pose, size, unit: Unit::Centimetre })
}

/// The sockets of the cameras.
struct Sockets<'a> {
    left: i64,
    right: i64,
    /// The entry with the sockets of the pair.
    stereo: Entry<'a>,
    cameras: Entry<'a>,
}

impl<'a> Sockets<'a> {
    fn read(entries: &Entries<'a>) -> Result<Self> {
        let expected = "the sockets of the left and the right camera";
        let stereo = entries.require("stereorectificationdata", "stereoRectificationData", expected)?;
        let sockets = stereo.group()?;
        let left = sockets.number("leftcamerasocket", "leftCameraSocket")? as i64;
        let right = sockets.number("rightcamerasocket", "rightCameraSocket")? as i64;
        let cameras = entries.require("cameradata", "cameraData", "a list of cameras")?;
        Ok(Self { left, right, stereo, cameras })
    }

    /// The pose of a camera relative to the left one.
    fn pose_of(&self, socket: i64) -> Result<Pose> {
        // Extrinsics form a chain of cameras, so they lead one way or the other.
        if let Some(pose) = chain(&self.cameras, self.left, socket)? {
            return Ok(pose);
        }
        let back = chain(&self.cameras, socket, self.left)?;
        let pose = back.map(|pose| pose.inverse());
        pose.ok_or_else(|| self.stereo.error("has cameras between which no extrinsics lead; calibrate again"))
    }
}

/// The camera at a socket. Cameras are listed as pairs of socket and calibration.
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

/// The pose of the camera at `to` relative to that at `from`, if extrinsics lead there.
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
        // The remaining coefficients of a fisheye are 0.
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
