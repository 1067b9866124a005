//! KITTI's calibrations: `P0` to `P3` of its odometry, and `calib_cam_to_cam.txt`, which also has the lenses.
//! `DrivingStereo` uses the same entries with cameras 101 and 103.

use super::cameras::{Pose, RectifiedViews, StereoCalibration};
use super::lens::Lens;
use super::matrix::{IDENTITY, length};
use super::node::{Entries, Entry};
use super::opencv::{self, Projection};
use crate::error::{Error, Result};
use crate::image::calib::{Camera, Unit};

/// Cameras 0 and 1 are grey, 2 and 3 in colour.
const GREY: [usize; 2] = [0, 1];
const COLOUR: [usize; 2] = [2, 3];
/// The left and right camera of `DrivingStereo`.
const DRIVING_STEREO: [usize; 2] = [101, 103];

/// Whether the file is KITTI's: whether a projection has a name that OpenCV does not use.
pub(super) fn is(entries: &Entries) -> bool {
    let own = "prect00 prect01 prect02 prect03 prect101 prect103 p0 p3";
    entries.find_all(own).any(|entry| entry.is_matrix()) && !opencv::has_lens(entries)
}

/// The name of an entry of a camera, numbered with at least two digits.
fn of_camera(stem: &str, camera: usize) -> String {
    format!("{stem}{camera:02}")
}

fn projection_names(camera: usize) -> String {
    format!("{} p{camera}", of_camera("prect", camera))
}

pub(super) fn read(entries: &Entries) -> Result<StereoCalibration> {
    let cameras = pair(entries)?;
    let sizes = cameras.map(|camera| size(entries, "srect", camera));
    let [size, other] = sizes;
    let (size, other) = (size?, other?);
    if size != other {
        return Err(differs(entries, "srect", cameras));
    }
    let mut calibration = StereoCalibration { unit: Unit::Metre, ..StereoCalibration::default() };
    calibration.views = Some(RectifiedViews { size, ..views(entries, cameras)? });
    let [left, right] = cameras;
    if entries.find(&of_camera("k", left)).is_some() {
        calibration.lenses = Some([lens(entries, left)?, lens(entries, right)?]);
        calibration.pose = Some(pose(entries, cameras)?);
        calibration.size = self::size(entries, "s", left)?;
        if self::size(entries, "s", right)? != calibration.size {
            return Err(differs(entries, "s", cameras));
        }
        // Files for images of half the size keep the offsets of full size, which double the baseline.
        if let (DRIVING_STEREO, Some(pose), Some(views)) =
            (cameras, &calibration.pose, &mut calibration.views)
        {
            views.translation[0] = length(pose.translation).copysign(views.translation[0]);
        }
    } else {
        calibration.size = size;
    }
    Ok(calibration)
}

/// The cameras of the pair: the colour ones, unless they are missing or the file asks for the grey ones.
fn pair(entries: &Entries) -> Result<[usize; 2]> {
    if entries.find(&projection_names(DRIVING_STEREO[0])).is_some() {
        return Ok(DRIVING_STEREO);
    }
    let Some(entry) = entries.find("pair") else {
        let colour = COLOUR.iter().any(|camera| entries.find(&projection_names(*camera)).is_some());
        return Ok(if colour { COLOUR } else { GREY });
    };
    match entry.word()? {
        "grey" | "gray" => Ok(GREY),
        "colour" | "color" => Ok(COLOUR),
        _ => Err(entry.wrong("grey (cameras 0 and 1) or colour (2 and 3)")),
    }
}

/// The size of the images, such as `S_rect_02: 1.242000e+03 3.750000e+02`.
fn size(entries: &Entries, stem: &str, camera: usize) -> Result<Option<(usize, usize)>> {
    entries.find(&of_camera(stem, camera)).map(|entry| entry.size()).transpose()
}

fn differs(entries: &Entries, stem: &str, [left, right]: [usize; 2]) -> Error {
    let expected = format!("the size that camera {left} has");
    match entries.find(&of_camera(stem, right)) {
        Some(entry) => entry.wrong(&expected),
        None => {
            Error::read(entries.path(), format!("the size of camera {right} is missing: expected {expected}"))
        }
    }
}

fn views(entries: &Entries, cameras: [usize; 2]) -> Result<RectifiedViews> {
    let mut rotations = [IDENTITY; 2];
    let mut projections = Vec::new();
    for (rotation, camera) in rotations.iter_mut().zip(cameras) {
        // Rectified images have no rotation.
        if let Some(entry) = entries.find(&of_camera("rrect", camera)) {
            *rotation = entry.rotation(&entry.matrix()?)?;
        }
        let names = projection_names(camera);
        let expected = "the projection of the rectified camera, a matrix of 3 x 4";
        projections.push(projection(&entries.require(&names, &format!("P{camera}"), expected)?)?);
    }
    let entry = entries.require(&projection_names(cameras[1]), "P", "")?;
    opencv::rectified(&entry, rotations, [projections[0], projections[1]])
}

/// The fourth column is the camera matrix times the position of the camera, so all three numbers count.
fn projection(entry: &Entry) -> Result<Projection> {
    match entry.matrix::<3, 4>()? {
        [[fx, 0.0, cx, tx], [0.0, fy, cy, ty], [0.0, 0.0, 1.0, tz]] if fx > 0.0 && fy > 0.0 => {
            let camera = Camera { focal_length: [fx, fy], principal_point: [cx, cy] };
            Ok(Projection { camera, offset: [(tx - cx * tz) / fx, (ty - cy * tz) / fy] })
        }
        _ => Err(entry.wrong("a projection like [f 0 cx tx; 0 f cy ty; 0 0 1 tz] with f above 0")),
    }
}

fn lens(entries: &Entries, camera: usize) -> Result<Lens> {
    let expected = "the matrix [f 0 cx; 0 f cy; 0 0 1] of the camera";
    let matrix = entries.require(&of_camera("k", camera), &of_camera("K_", camera), expected)?;
    let (focal_length, principal_point) = opencv::camera(&matrix)?;
    let expected = "the 5 coefficients of the lens";
    let entry = entries.require(&of_camera("d", camera), &of_camera("D_", camera), expected)?;
    let distortion = opencv::distortion(&entry, expected, false)?;
    Lens::new(focal_length, principal_point, distortion).map_err(|_| matrix.wrong("a camera with its lens"))
}

/// The pose of the right camera relative to the left one; the file has both relative to camera 0.
fn pose(entries: &Entries, [left, right]: [usize; 2]) -> Result<Pose> {
    let (left, right) = (from_first(entries, left)?, from_first(entries, right)?);
    let pose = Pose::between(&left.0, &right.0);
    if length(pose.translation) == 0.0 {
        return Err(right.1.wrong("the two cameras apart"));
    }
    Ok(pose)
}

/// The pose of a camera relative to camera 0, and the entry of its translation.
fn from_first<'a>(entries: &Entries<'a>, camera: usize) -> Result<(Pose, Entry<'a>)> {
    let expected = "the rotation from camera 0";
    let entry = entries.require(&of_camera("r", camera), &of_camera("R_", camera), expected)?;
    let rotation = entry.rotation(&entry.matrix()?)?;
    let expected = "3 numbers, camera 0 in the frame of this one";
    let entry = entries.require(&of_camera("t", camera), &of_camera("T_", camera), expected)?;
    Ok((Pose { rotation, translation: entry.numbers(expected)? }, entry))
}
