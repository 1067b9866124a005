//! Calibrations of pairs of cameras, as the programs that people have write them.
//!
//! [`read`] takes the files of OpenCV, ROS, Kalibr, EuRoC, ORB-SLAM, VINS-Fusion, Basalt, ZED, OAK and RealSense cameras, COLMAP, mrcal, OKVIS,
//! KITTI, Cityscapes and Middlebury, and tells them apart by their content. [`Rectification`](crate::rectification::Rectification) rectifies by them, and
//! [`Rig`](crate::depth::Rig) takes depths from them. [`third::read`] takes a camera beside the pair, into whose view depths are rendered.

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
mod posed;
mod realsense;
mod ros;
mod syntax;
pub mod third;
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

/// A calibration is a few kilobytes; no more than this is read.
const MAX_BYTES: u64 = 1 << 20;

/// An archive of numpy may also hold maps, which are passed over.
const MAX_ARCHIVE: u64 = 1 << 28;

/// What a file should be, as an error says it.
const KNOWN: &str = "is no calibration of a known form: expected the entries of OpenCV (K1, D1, K2, D2, R, T), ROS (camera_matrix, projection_matrix), Kalibr (cam0, \
                     cam1), EuRoC (T_BS), KITTI (P0 to P3), or of another program that the guide lists";

/// What reads the entries of a file, or of several, in a form.
type Read = fn(&[Entries]) -> Option<Result<StereoCalibration>>;

/// The forms in which calibrations are read, each with its name. `None` from those that it is not.
const FORMS: [(&str, Read); 16] = [
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

/// What a calibration file holds: [`of_texts`] takes it. It is unpacked where it is packed by gzip, and the arrays of an `.npz` are lines.
///
/// # Errors
/// [`Error::Read`] when it cannot be read, is larger than any calibration, or is of a kind that is none, such as an image.
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
    // As Windows saves what it calls Unicode.
    let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    Ok(char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect())
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

/// What the files say in the first form that takes them, and its name.
fn in_some_form<'a>(each: &[Entries]) -> Option<(&'a str, Result<StereoCalibration>)> {
    FORMS.iter().find_map(|(name, read)| {
        let found = read(each)?.and_then(|found| in_stated_unit(found, each));
        Some((*name, found.map_err(|error| in_form(error, name))))
    })
}

/// What a file states counts, whatever the unit of its form is.
fn in_stated_unit(mut found: StereoCalibration, each: &[Entries]) -> Result<StereoCalibration> {
    let stated = opencv::unit(&Entries::together(each))?;
    if stated != Unit::Unknown {
        found.set_unit(stated);
    }
    Ok(found)
}

/// An error about a file beside one that says all.
fn not_needed(file: &Path, whole: &Path, form: &str) -> Error {
    let reason = format!(
        "is not needed: {} is a whole calibration (read as {form}); leave one of them out",
        whole.display()
    );
    Error::read(file, reason)
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
        Err(_) => Err(Error::read(path, "is damaged gzip, or a part of it is missing; copy it again")),
    }
}

/// The entries of a file, for each camera where it has them apart.
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
        return Err(wrong("is empty; it is to be a calibration".into()));
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
        // What only might be YAML is not to be told its errors.
        _ => syntax::yaml(text)
            .map_err(|reason| if syntax::is_yaml(path, text) { reason } else { KNOWN.into() }),
    };
    root.map_err(wrong)
}
