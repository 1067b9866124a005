//! Reads the calibrations of stereo cameras in the forms of many programs.
//!
//! [`read`] takes the files of OpenCV, ROS, Kalibr, EuRoC, ORB-SLAM, VINS-Fusion, Basalt, ZED, OAK and RealSense cameras, COLMAP, mrcal,
//! OKVIS, KITTI, Cityscapes and Middlebury, and tells them apart by their content. [`third::read`] reads a camera beside the pair, into
//! whose view depths can be rendered, and [`pose::read`] the place of a lidar.

mod basalt;
pub mod cameras;
mod camodocal;
mod cityscapes;
mod colmap;
mod depthai;
mod euroc;
mod foreign;
mod kalibr;
mod kitti;
pub mod lens;
mod listed;
pub mod matrix;
mod middlebury;
mod models;
mod mrcal;
mod node;
mod numpy;
mod opencv;
mod orbslam;
mod ost;
mod parts;
pub mod pose;
mod posed;
mod realsense;
mod ros;
mod syntax;
pub mod third;
pub mod trajectory;
pub mod write;
mod zed;

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use flate2::read::GzDecoder;

use cameras::StereoCalibration;
use node::{Entries, Node};

use crate::error::{Error, Result};
use crate::image::calib::Unit;
use crate::text;

/// The limit for a file; calibrations are a few kilobytes.
const MAX_BYTES: u64 = 1 << 20;

/// An archive of numpy may also hold large maps, which are skipped.
const MAX_ARCHIVE: u64 = 1 << 28;

/// The error for a file of no known form.
const KNOWN: &str = "is no calibration of a known form: expected the entries of OpenCV (K1, D1, K2, D2, R, T), ROS (camera_matrix, projection_matrix), Kalibr (cam0, \
                     cam1), EuRoC (T_BS), KITTI (P0 to P3), or of another program that the guide lists";

/// Reads one or more files in a form; `None` if they are not of this form.
type Read = fn(&[Entries]) -> Option<Result<StereoCalibration>>;

/// The forms of calibrations, each with its name. The first one that takes the files counts.
const FORMS: &[(&str, Read)] = &[
    ("Kalibr's", |files| alone(files, kalibr::is, kalibr::read)),
    ("KITTI's", |files| alone(files, kitti::is, kitti::read)),
    ("Basalt's", |files| alone(files, basalt::is, basalt::read)),
    ("DepthAI's", |files| alone(files, depthai::is, depthai::read)),
    ("RealSense's", |files| alone(files, realsense::is, realsense::read)),
    ("ZED's", |files| alone(files, zed::is, zed::read)),
    ("ORB-SLAM's", |files| alone(files, orbslam::is, orbslam::read)),
    ("OKVIS's", |files| alone(files, listed::is, listed::read)),
    ("Cityscapes's", |files| alone(files, cityscapes::is, cityscapes::read)),
    ("COLMAP's", |files| files.iter().all(colmap::is).then(|| colmap::read(&Entries::together(files)))),
    ("mrcal's", |files| match files {
        [left, right] if mrcal::is(left) && mrcal::is(right) => Some(mrcal::read([left, right])),
        [one] if mrcal::is(one) => Some(other_missing(one, "lensmodel")),
        _ => None,
    }),
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
        (opencv::needs_all(files) && opencv::is(&all)).then(|| opencv::read(&all))
    }),
    ("OpenCV's", parts::read),
];

/// Reads a form of one file, if the files are that.
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

/// Reads a calibration from one file, or from several: ROS's and EuRoC's of the left and the right camera,
/// OpenCV's of the lenses and of the pose, COLMAP's two, or VINS-Fusion's three. They may be packed by gzip.
///
/// # Errors
/// [`Error::Read`] when a file cannot be read, or an entry is wrong or missing; the error names the file and the entry.
pub fn read(files: &[PathBuf]) -> Result<StereoCalibration> {
    of_texts(&files.iter().map(|path| Ok((path.as_path(), text(path)?))).collect::<Result<Vec<_>>>()?)
}

/// The text of a calibration file, for [`of_texts`]. Unpacks gzip, and turns the arrays of an `.npz` into lines.
///
/// # Errors
/// [`Error::Read`] when it cannot be read, is too large, or is another kind of file, such as an image.
pub fn text(file: &Path) -> Result<String> {
    let wrong = |reason: String| Error::read(file, reason);
    if file.is_dir() {
        return Err(wrong("is a folder; give the calibration that is in it".into()));
    }
    let mut head = Vec::new();
    let read = File::open(file).and_then(|file| file.take(512).read_to_end(&mut head));
    read.map_err(|e| Error::opening(file, e))?;
    if numpy::is_archive(&head) {
        let bytes = text::read(file, MAX_ARCHIVE, "calibration file")?;
        if numpy::is(&bytes) {
            return numpy::text(&bytes).map_err(wrong);
        }
    }
    if let Some(reason) = foreign::of_bytes(&head) {
        return Err(wrong(reason));
    }
    let bytes = unpacked(file, text::read(file, MAX_BYTES, "calibration file")?)?;
    if let Some(reason) = foreign::of_bytes(&bytes) {
        return Err(wrong(reason));
    }
    let unit = match bytes[..] {
        [0xff, 0xfe, ..] => u16::from_le_bytes,
        [0xfe, 0xff, ..] => u16::from_be_bytes,
        _ => return Ok(String::from_utf8_lossy(&bytes).into_owned()),
    };
    // UTF-16, which Windows calls Unicode.
    let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    Ok(char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect())
}

/// Like [`read`], for files in memory, each with its name for errors.
///
/// # Errors
/// The errors of [`read`].
pub fn of_texts(files: &[(&Path, String)]) -> Result<StereoCalibration> {
    if let [(path, text)] = files
        && middlebury::is(text)
    {
        return middlebury::of_text(path, text);
    }
    if let [_, _, _, (fourth, _), ..] = files {
        return Err(Error::read(fourth, "is one too many; a calibration has at most three files"));
    }
    if let [_, _, ..] = files
        && let Some(whole) = files.iter().position(|(_, text)| middlebury::is(text))
    {
        return Err(not_needed(files[usize::from(whole == 0)].0, files[whole].0, "Middlebury's"));
    }
    let mut roots: Vec<(&Path, Node)> = Vec::new();
    for (path, text) in files {
        roots.extend(self::roots(path, text)?.into_iter().map(|root| (*path, root)));
    }
    let each: Vec<Entries> = roots.iter().map(|(path, root)| Entries::new(vec![(path, root)])).collect();
    if each.is_empty() {
        return Err(Error::Calibration("has no file".into()));
    }
    if let Some((_, found)) = in_some_form(&each) {
        return found;
    }
    let wrong = |file: &Entries, reason: &str| Err(Error::read(file.path(), reason));
    let whole = |one: &Entries| in_some_form(std::slice::from_ref(one)).filter(|(_, found)| found.is_ok());
    let found = each.iter().enumerate().find_map(|(i, one)| whole(one).map(|(name, _)| (i, name)));
    match (&each[..], found) {
        ([] | [_], _) => wrong(&each[0], KNOWN),
        (all, Some((i, name))) => Err(not_needed(all[usize::from(i == 0)].path(), all[i].path(), name)),
        ([.., last], None) => wrong(
            last,
            "does not belong to the other files; give one, two of ROS, EuRoC, OpenCV, mrcal or COLMAP, or three of VINS-Fusion",
        ),
    }
}

/// Reads the files in the first form that takes them; with the name of the form.
fn in_some_form<'a>(each: &[Entries]) -> Option<(&'a str, Result<StereoCalibration>)> {
    FORMS.iter().find_map(|(name, read)| {
        let found = read(each)?.and_then(|found| in_stated_unit(found, each));
        Some((*name, found.map_err(|error| in_form(error, name))))
    })
}

/// A unit that the files state overrides that of the form.
fn in_stated_unit(mut found: StereoCalibration, each: &[Entries]) -> Result<StereoCalibration> {
    let stated = opencv::unit(&Entries::together(each))?;
    if stated != Unit::Unknown {
        found.set_unit(stated);
    }
    Ok(found)
}

/// The error for a file beside one that is complete.
fn not_needed(file: &Path, whole: &Path, form: &str) -> Error {
    let reason = format!(
        "is not needed: {} is a whole calibration (read as {form}); leave one of them out",
        whole.display()
    );
    Error::read(file, reason)
}

/// Adds the form in which the file was read to an error.
fn in_form(error: Error, name: &str) -> Error {
    match error {
        Error::Read { path, cause } => Error::read(path, format!("{cause} (read as {name})")),
        error => error,
    }
}

/// The bytes of a file, unpacked if packed by gzip.
fn unpacked(path: &Path, bytes: Vec<u8>) -> Result<Vec<u8>> {
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        return Ok(bytes);
    }
    let mut unpacked = Vec::new();
    let read = GzDecoder::new(&bytes[..]).take(MAX_BYTES + 1).read_to_end(&mut unpacked);
    match read {
        Ok(count) if count as u64 <= MAX_BYTES => Ok(unpacked),
        Ok(_) => Err(Error::read(path, "is larger, once unpacked, than any calibration file; is it one?")),
        Err(_) => Err(Error::read(path, "is damaged gzip, or a part of it is missing; copy it again")),
    }
}

/// The entries of a file, one set for each camera if it separates them.
fn roots(path: &Path, text: &str) -> Result<Vec<Node>> {
    let plain = text.trim_start_matches('\u{feff}').trim_start();
    if ost::is(plain) {
        return ost::parse(plain).map_err(|reason| Error::read(path, reason));
    }
    root(path, text).map(|root| vec![root])
}

/// The entries of a file.
fn root(path: &Path, text: &str) -> Result<Node> {
    let text = text.trim_start_matches('\u{feff}').trim_start();
    let wrong = |reason: String| Error::read(path, reason);
    if text.is_empty() {
        return Err(wrong("is empty; give a calibration".into()));
    }
    if let Some(node) = colmap::parse(text) {
        return Ok(node);
    }
    if let Some(reason) = foreign::of_text(text) {
        return Err(wrong(reason));
    }
    if let Some(root) = mrcal::parse(text) {
        return root.map_err(wrong);
    }
    let root = match text.chars().next() {
        Some('<') if syntax::is_xml(text) => syntax::xml(text),
        Some('{') if syntax::is_json(text) => syntax::json(text),
        Some('[') if syntax::is_ini(text) => syntax::ini(text),
        // Report YAML errors only for files that are certainly YAML.
        _ => syntax::yaml(text)
            .map_err(|reason| if syntax::is_yaml(path, text) { reason } else { KNOWN.into() }),
    };
    root.map_err(wrong)
}
