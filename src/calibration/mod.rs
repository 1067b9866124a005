//! Calibrations of pairs of cameras, as the programs that people have write them.
//!
//! [`read`] takes the files of OpenCV, ROS, Kalibr, EuRoC, ORB-SLAM, VINS-Fusion, Basalt, ZED, OAK and RealSense cameras, COLMAP, KITTI and
//! Middlebury, and tells them apart by their content. [`Rectification`](crate::rectification::Rectification) rectifies by them, and
//! [`Rig`](crate::depth::Rig) takes depths from them. [`third::read`] takes a camera beside the pair, into whose view depths are rendered.

mod basalt;
pub mod cameras;
mod camodocal;
mod colmap;
mod depthai;
mod euroc;
mod kalibr;
mod kitti;
pub mod lens;
pub mod matrix;
mod middlebury;
mod models;
mod node;
mod opencv;
mod orbslam;
mod posed;
mod realsense;
mod ros;
mod syntax;
pub mod third;
pub mod write;
mod zed;

use std::io::Read as _;
use std::path::{Path, PathBuf};

use flate2::read::GzDecoder;

use cameras::StereoCalibration;
use node::{Entries, Node};

use crate::error::{Error, Result};
use crate::text;

/// A calibration is a few kilobytes; no more than this is read.
const MAX_BYTES: u64 = 1 << 20;

/// What a file should be, as an error says it.
const KNOWN: &str = "expected the entries of OpenCV (K1, D1, K2, D2, R, T), ROS (camera_matrix, projection_matrix), Kalibr (cam0, \
                     cam1), EuRoC (T_BS), KITTI (P0 to P3), or of another program that the guide lists";

/// What reads the entries of a file, or of several, in a form.
type Read = fn(&[Entries]) -> Option<Result<StereoCalibration>>;

/// The forms in which calibrations are read, each with its name. `None` from those that it is not.
const FORMS: [(&str, Read); 12] = [
    ("Kalibr's", |files| alone(files, kalibr::is, kalibr::read)),
    ("KITTI's", |files| alone(files, kitti::is, kitti::read)),
    ("Basalt's", |files| alone(files, basalt::is, basalt::read)),
    ("DepthAI's", |files| alone(files, depthai::is, depthai::read)),
    ("RealSense's", |files| alone(files, realsense::is, realsense::read)),
    ("ZED's", |files| alone(files, zed::is, zed::read)),
    ("ORB-SLAM's", |files| alone(files, orbslam::is, orbslam::read)),
    ("COLMAP's", |files| files.iter().any(colmap::is).then(|| colmap::read(&Entries::together(files)))),
    ("EuRoC's", |files| match files {
        [left, right] if euroc::is(left) && euroc::is(right) => Some(euroc::read([left, right])),
        [one] if euroc::is(one) => Some(other_missing(one, "T_BS")),
        _ => None,
    }),
    ("camodocal's", |files| {
        let cameras: Vec<&Entries> = files.iter().filter(|file| camodocal::is(file)).collect();
        let rig = files.iter().find(|file| camodocal::is_rig(file));
        match (rig, &cameras[..]) {
            (Some(rig), [left, right]) => Some(camodocal::read(rig, [left, right])),
            (None, []) => None,
            (_, found) => Some(Err(Error::read(
                files[0].path(),
                format!(
                    "is one of three files, and there {} of how the cameras stand (body_T_cam0 and body_T_cam1 of VINS-Fusion, or \
                     camodocal's transform) and {} of a camera; give that and the files of both cameras, left and right",
                    if rig.is_some() { "is one" } else { "is none" },
                    found.len()
                ),
            ))),
        }
    }),
    ("ROS's", |files| match files {
        [left, right] if ros::is(left) && ros::is(right) => Some(ros::read([left, right])),
        [one] if ros::is(one) => Some(other_missing(one, "camera_matrix")),
        _ => None,
    }),
    ("OpenCV's", |files| {
        let all = Entries::together(files);
        (files.len() <= 2 && opencv::is(&all)).then(|| opencv::read(&all))
    }),
];

/// What `read` reads of a form that has one file, where it `is` that.
fn alone(
    files: &[Entries],
    is: fn(&Entries) -> bool,
    read: fn(&Entries) -> Result<StereoCalibration>,
) -> Option<Result<StereoCalibration>> {
    match files {
        [one] if is(one) => Some(read(one)),
        _ => None,
    }
}

fn other_missing(one: &Entries, entry: &str) -> Result<StereoCalibration> {
    Err(Error::read(one.path(), format!("{entry}: is of one camera; give the file of the other one too")))
}

/// Reads a calibration from one file, or from several that belong together: ROS's and EuRoC's for the left and the right camera,
/// OpenCV's for the lenses and for how the cameras stand, COLMAP's two, or VINS-Fusion's three. They may be packed by gzip.
///
/// # Errors
/// [`Error::Read`] when a file cannot be read, or an entry is wrong or missing; the error names the file and the entry.
pub fn read(files: &[PathBuf]) -> Result<StereoCalibration> {
    of_texts(&files.iter().map(|path| Ok((path.as_path(), text(path)?))).collect::<Result<Vec<_>>>()?)
}

/// What a calibration file holds, unpacked where it is packed by gzip: [`of_texts`] takes it.
///
/// # Errors
/// [`Error::Read`] when it cannot be read, or is larger than any calibration.
pub fn text(file: &Path) -> Result<String> {
    let bytes = unpacked(file, text::read(file, MAX_BYTES, "calibration file")?)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
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
    if let [_, _, _, (fourth, _), ..] = files {
        return Err(Error::read(fourth, "is one too many; a calibration has at most three files"));
    }
    let roots: Vec<(&Path, Node)> =
        files.iter().map(|(path, text)| Ok((*path, root(path, text)?))).collect::<Result<_>>()?;
    let each: Vec<Entries> = roots.iter().map(|(path, root)| Entries::new(vec![(path, root)])).collect();
    let wrong = |file: &Entries, reason: &str| Err(Error::read(file.path(), reason));
    for (name, read) in FORMS {
        if let Some(found) = read(&each) {
            return found.map_err(|error| in_form(error, name));
        }
    }
    match &each[..] {
        [] => Err(Error::Calibration("has no file".into())),
        [one] => wrong(one, KNOWN),
        [.., last] => wrong(
            last,
            "does not belong to the other files; give one, two of ROS, EuRoC, OpenCV or COLMAP, or three of VINS-Fusion",
        ),
    }
}

/// An error that says in which form the file was read.
fn in_form(error: Error, name: &str) -> Error {
    match error {
        Error::Read { path, cause } => Error::read(path, format!("{cause} (read as {name})")),
        error => error,
    }
}

/// What a file holds, unpacked where it is packed by gzip.
fn unpacked(path: &Path, bytes: Vec<u8>) -> Result<Vec<u8>> {
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        return Ok(bytes);
    }
    let mut unpacked = Vec::new();
    let read = GzDecoder::new(&bytes[..]).take(MAX_BYTES + 1).read_to_end(&mut unpacked);
    match read {
        Ok(count) if count as u64 <= MAX_BYTES => Ok(unpacked),
        Ok(_) => Err(Error::read(path, "unpacked, is larger than any calibration file; is it one?")),
        Err(error) => Err(Error::read(path, format!("is damaged gzip: {error}; copy it again"))),
    }
}

/// The entries of a file.
fn root(path: &Path, text: &str) -> Result<Node> {
    let text = text.trim_start_matches('\u{feff}').trim_start();
    if let Some(node) = colmap::parse(text) {
        return Ok(node);
    }
    let root = match text.chars().next() {
        Some('<') => syntax::xml(text),
        Some('{') => syntax::json(text),
        Some('[') if syntax::is_ini(text) => syntax::ini(text),
        _ => syntax::yaml(text),
    };
    root.map_err(|reason| Error::read(path, reason))
}
