//! A third camera beside the pair, such as the colour camera of a rig, and its pose relative to the left one.

use std::path::Path;

use super::cameras::ThirdCamera;
use super::node::Entries;
use super::{depthai, in_form, kalibr, opencv, pose, root, text};
use crate::error::{Error, Result};
use crate::image::read::MAX_PIXELS;

/// Reads a third camera from a file: a camera with OpenCV's names (K, D, R, T and `image_size`, or those of
/// ROS's `camera_info`), the last camera of Kalibr's chain, or the camera of an OAK that is not one of its pair.
///
/// # Errors
/// [`Error::Read`] when the file cannot be read, or an entry is wrong or missing; the error names the file and the entry.
pub fn read(file: &Path) -> Result<ThirdCamera> {
    of_text(file, &text(file)?)
}

/// Like [`read`], for a text in memory, which errors call `name`.
///
/// # Errors
/// The errors of [`read`].
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

/// A camera with OpenCV's names for a single one.
fn one(entries: &Entries) -> Result<ThirdCamera> {
    let lens = opencv::lens_alone(entries)?;
    let size = opencv::size(entries)?.ok_or_else(|| {
        Error::read(entries.path(), "image_size is missing: expected width and height of its images")
    })?;
    // It may be at the place of the left camera.
    let expected = "3 numbers, the left camera in the frame of this one";
    let pose = pose::of_entries(entries, "the rotation from the left camera to this one", expected)?;
    Ok(ThirdCamera { lens, pose, size, unit: opencv::unit(entries)? })
}
