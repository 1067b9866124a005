//! A third camera: one beside the pair, such as the colour camera of a rig, and how it stands to the left one.

use std::path::Path;

use super::cameras::{Pose, ThirdCamera};
use super::lens::Lens;
use super::node::Entries;
use super::{depthai, in_form, kalibr, opencv, root, text};
use crate::error::{Error, Result};
use crate::image::read::MAX_PIXELS;

// In lower case and without `_`, as `Entries::find` takes them.
const CAMERA: &str = "k cameramatrix m intrinsicmatrix mtx";
const DISTORTION: &str = "d distortioncoefficients distcoeffs dist";

/// Whether there is the lens of one camera.
pub(super) fn has_lens(entries: &Entries) -> bool {
    entries.find_all(CAMERA).any(|entry| entry.is_matrix())
}

/// Reads a third camera from a file: one camera by OpenCV's names (K, D, R, T and `image_size`, or those of ROS's `camera_info`), the last
/// camera of Kalibr's chain, or the camera of an OAK's calibration that is not one of its pair.
///
/// # Errors
/// [`Error::Read`] when the file cannot be read, or an entry is wrong or missing; the error names the file and the entry.
pub fn read(file: &Path) -> Result<ThirdCamera> {
    of_text(file, &text(file)?)
}

/// As [`read`], of a file that is in memory, which errors call `name`.
///
/// # Errors
/// Those of [`read`].
pub fn of_text(name: &Path, text: &str) -> Result<ThirdCamera> {
    let root = root(name, text)?;
    let entries = Entries::new(vec![(name, &root)]);
    let (form, found) = if kalibr::is(&entries) {
        ("Kalibr's", kalibr::last(&entries))
    } else if depthai::is(&entries) {
        ("DepthAI's", depthai::third(&entries))
    } else {
        ("OpenCV's", one(&entries))
    };
    let camera = found.map_err(|error| in_form(error, form))?;
    let (width, height) = camera.size;
    if width as u64 * height as u64 > MAX_PIXELS {
        return Err(Error::read(name, format!("has images of {width} x {height}, which are too large")));
    }
    Ok(camera)
}

/// By OpenCV's names, without the number that they have in a pair.
fn one(entries: &Entries) -> Result<ThirdCamera> {
    let lens = lens(entries)?;
    let size = opencv::size(entries)?.ok_or_else(|| {
        Error::read(entries.path(), "image_size is missing: expected width and height of its images")
    })?;
    Ok(ThirdCamera { lens, pose: pose(entries)?, size, unit: opencv::unit(entries)? })
}

/// The lens of one camera, without the number that it has in a pair.
pub(super) fn lens(entries: &Entries) -> Result<Lens> {
    let expected =
        "the matrix [f 0 cx; 0 f cy; 0 0 1] of one camera; or give Kalibr's chain, or the file of an OAK";
    let matrix = entries.require(CAMERA, "K", expected)?;
    let (focal_length, principal_point) = opencv::camera(&matrix)?;
    let expected = "the distortion of the lens, 0 0 0 0 for none";
    let entry = entries.require(DISTORTION, "D", expected)?;
    let distortion = opencv::distortion(&entry, expected, opencv::is_fisheye(entries)?)?;
    Lens::new(focal_length, principal_point, distortion).map_err(|_| matrix.wrong("a camera with its lens"))
}

/// From the left camera. The third one may stand in its place.
fn pose(entries: &Entries) -> Result<Pose> {
    let expected = "3 numbers, the left camera in the frame of this one";
    let translation = entries.require(opencv::TRANSLATION, "T", expected)?;
    // Both in one matrix.
    if entries.find(opencv::ROTATION).is_none() && translation.numbers::<16>(expected).is_ok() {
        return translation.pose();
    }
    Ok(Pose {
        rotation: opencv::rotation_to(entries, "this one")?,
        translation: translation.numbers(expected)?,
    })
}
