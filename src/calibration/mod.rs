//! Calibrations of pairs of cameras, as the programs that people have write them.
//!
//! [`read`] takes OpenCV's YAML and XML, ROS's `camera_info`, Kalibr's camera chain and Middlebury's `calib.txt`, and tells them
//! apart by their content. [`Rectification`](crate::rectification::Rectification) rectifies by them, and
//! [`Rig`](crate::depth::Rig) takes depths from them.

pub mod cameras;
mod kalibr;
pub mod lens;
pub mod matrix;
mod middlebury;
mod models;
mod node;
mod opencv;
mod ros;
mod syntax;
pub mod write;

use std::path::{Path, PathBuf};

use cameras::StereoCalibration;
use node::{Entries, Node};

use crate::error::{Error, Result};
use crate::text;

/// A calibration is a few kilobytes; no more than this is read.
const MAX_BYTES: u64 = 1 << 20;

/// What a file should be, as an error says it.
const KNOWN: &str = "expected the entries of OpenCV (K1, D1, K2, D2, R, T), of ROS (camera_matrix, projection_matrix), of Kalibr \
                     (cam0, cam1) or of Middlebury's calib.txt (cam0=...)";

/// Reads a calibration from one file, or from two that belong together: ROS's for the left and the right camera, in any
/// order, or OpenCV's for the lenses and for how the cameras stand.
///
/// # Errors
/// [`Error::Read`] when a file cannot be read, or an entry is wrong or missing; the error names the file and the entry.
pub fn read(files: &[PathBuf]) -> Result<StereoCalibration> {
    let texts = files.iter().map(|path| {
        let bytes = text::read(path, MAX_BYTES, "calibration file")?;
        Ok((path.as_path(), String::from_utf8_lossy(&bytes).into_owned()))
    });
    of_texts(&texts.collect::<Result<Vec<_>>>()?)
}

/// As [`read`], of files that are in memory, each with the name by which errors call it.
///
/// # Errors
/// Those of [`read`].
pub fn of_texts(files: &[(&Path, String)]) -> Result<StereoCalibration> {
    if let [(path, text)] = files
        && middlebury::is(text)
    {
        return middlebury::of_text(path, text);
    }
    let roots: Vec<(&Path, Node)> =
        files.iter().map(|(path, text)| Ok((*path, root(path, text)?))).collect::<Result<_>>()?;
    let each: Vec<Entries> = roots.iter().map(|(path, root)| Entries::new(vec![(path, root)])).collect();
    let all = Entries::new(roots.iter().map(|(path, root)| (*path, root)).collect());
    let wrong = |path: &Path, reason: &str| Err(Error::read(path, reason));
    match each.as_slice() {
        [one] if kalibr::is(one) => kalibr::read(one),
        [left, right] if ros::is(left) && ros::is(right) => ros::read([left, right]),
        [one] if ros::is(one) => {
            wrong(one.path(), "camera_matrix: is of one camera; give the file of the other one too")
        }
        [one] if opencv::is(one) => opencv::read(one),
        [_, _] if opencv::is(&all) => opencv::read(&all),
        [one] => wrong(one.path(), KNOWN),
        [_, two] => {
            wrong(two.path(), "does not belong to the other file; give two of ROS, two of OpenCV, or one")
        }
        [] => Err(Error::Calibration("has no file".into())),
        [_, _, third, ..] => wrong(third.path(), "is one too many; a calibration has one file or two"),
    }
}

/// The entries of a file.
fn root(path: &Path, text: &str) -> Result<Node> {
    let text = text.trim_start_matches('\u{feff}').trim_start();
    let root = if text.starts_with('<') { syntax::xml(text) } else { syntax::yaml(text) };
    root.map_err(|reason| Error::read(path, reason))
}
