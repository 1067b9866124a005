//! ROS's `camera_info`, one file for each camera, as `camera_calibration` saves it or as `rostopic echo` prints it.

use super::cameras::StereoCalibration;
use super::lens::Lens;
use super::matrix::Matrix;
use super::node::{Entries, Entry};
use super::opencv::{self, Projection};
use crate::error::{Error, Result};
use crate::image::calib::Unit;

const CAMERA: &str = "cameramatrix k";
const DISTORTION: &str = "distortioncoefficients d";
const RECTIFICATION: &str = "rectificationmatrix r";
const PROJECTION: &str = "projectionmatrix p";

/// Whether these entries are those of one camera.
pub(super) fn is(entries: &Entries) -> bool {
    entries.find(CAMERA).is_some()
        && (entries.find(PROJECTION).is_some() || entries.find("distortionmodel").is_some())
}

struct Info {
    lens: Lens,
    rotation: Matrix,
    projection: Projection,
    size: (usize, usize),
}

/// The calibration of two cameras in any order: the left one is that whose projection has no offset.
pub(super) fn read(cameras: [&Entries; 2]) -> Result<StereoCalibration> {
    let [first, second] = [info(cameras[0])?, info(cameras[1])?];
    let is_left = |info: &Info| info.projection.column.iter().all(|v| *v == 0.0);
    let ((left, right), entries) = match (is_left(&first), is_left(&second)) {
        (true, false) => ((first, second), cameras[1]),
        (false, true) => ((second, first), cameras[0]),
        _ => {
            let reason = format!(
                "projection_matrix: expected focal length times baseline in its fourth column here or in {}, and 0 in the \
                 other; give the files of a stereo calibration",
                cameras[0].path().display()
            );
            return Err(Error::read(cameras[1].path(), reason));
        }
    };
    if left.size != right.size {
        let reason = format!(
            "image_width, image_height: expected {} x {} as the left camera has, found {} x {}",
            left.size.0, left.size.1, right.size.0, right.size.1
        );
        return Err(Error::read(entries.path(), reason));
    }
    let entry = entries.require(PROJECTION, "projection_matrix", "")?;
    let rotations = [left.rotation, right.rotation];
    let views = opencv::rectified(&entry, rotations, [left.projection, right.projection])?;
    Ok(StereoCalibration {
        lenses: Some([left.lens, right.lens]),
        views: Some(views),
        size: Some(left.size),
        unit: Unit::Metre,
        ..StereoCalibration::default()
    }
    .with_pose_of_views())
}

fn info(entries: &Entries) -> Result<Info> {
    let matrix = entries.require(CAMERA, "camera_matrix", "a matrix of 3 x 3")?;
    let (focal_length, principal_point) = opencv::camera(&matrix)?;
    let expected = "plumb_bob, rational_polynomial or equidistant";
    // Older files do not say it.
    let model = entries.find("distortionmodel");
    let entry = entries.require(DISTORTION, "distortion_coefficients", "those of the lens")?;
    let fisheye = match model.as_ref().map_or(Ok("plumb_bob"), Entry::word)? {
        "plumb_bob" | "rational_polynomial" => false,
        "equidistant" | "fisheye" => true,
        _ => return Err(model.as_ref().unwrap_or(&entry).wrong(expected)),
    };
    let distortion = opencv::distortion(&entry, "the coefficients of the distortion", fisheye)?;
    let lens = Lens::new(focal_length, principal_point, distortion);
    let rotation = entries.require(RECTIFICATION, "rectification_matrix", "a rotation of 3 x 3")?;
    let projection = entries.require(PROJECTION, "projection_matrix", "a matrix of 3 x 4")?;
    let count = |names: &str, called| entries.require(names, called, "a number of pixels")?.count();
    Ok(Info {
        lens: lens.map_err(|_| matrix.wrong("a camera with its lens"))?,
        rotation: rotation.rotation(&rotation.matrix()?)?,
        projection: opencv::projection(&projection)?,
        size: (count("imagewidth width", "image_width")?, count("imageheight height", "image_height")?),
    })
}
