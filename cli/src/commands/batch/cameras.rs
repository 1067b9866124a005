//! Folders with the images of each camera in a folder, as KITTI has them.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use mrfgs::Error;

use crate::failure::Result;
use crate::pairs::folder::{CALIBRATION, Folder};
use crate::pairs::list::{Names, Row, holds_both};
use crate::sequences::{Pairing, files, in_name, pair};

use crate::text::shown;

/// KITTI's folders of grey images, whose cameras are not those that its calibrations are read for.
const GREY: [&str; 2] = ["image_0", "image_1"];

/// The folders of the left and the right images. A folder with several of these has the first.
const FOLDERS: [[&str; 2]; 4] = [["left", "right"], ["image_2", "image_3"], ["colored_0", "colored_1"], GREY];

/// Folders with a calibration for each scene of KITTI: 2015 and 2012.
const CALIBRATIONS: [&str; 2] = ["calib_cam_to_cam", "calib"];

/// The pairs in the folder `dir`, with paths relative to it: the images of two cameras, or files that hold both views each; `None` if it has
/// neither.
///
/// # Errors
/// If an image has no partner, or a name is unfit for a pair.
pub(super) fn pairs(dir: &Path) -> Result<Option<Vec<Row>>> {
    let holds = |name: &str| dir.join(name).is_dir() && Folder::to_match(&dir.join(name)).is_err();
    let Some(cameras) = FOLDERS.into_iter().find(|names| names.iter().all(|name| holds(name))) else {
        return Ok(Some(of_both_views(dir)?).filter(|rows| !rows.is_empty()));
    };
    let [left, right] = cameras.map(|name| files::list(&dir.join(name)));
    let (Some(left), Some(right)) = (left?, right?) else { return Ok(None) };
    let of_all = left.len() + right.len();
    let first = left[0].clone();
    let alone = |image: &Path, other: &str| {
        let reason = format!(
            "has no partner with its number or name in {other}; add it, or list the pairs in a CSV file"
        );
        Error::read(image, reason)
    };
    let images = [left.clone(), right.clone()];
    let [lefts, rights] =
        pair(images, Pairing::Common, &cameras.map(str::to_owned)).map_err(|_| alone(&first, cameras[1]))?;
    if lefts.len() + rights.len() < of_all {
        let single =
            |all: Vec<PathBuf>, paired: &[PathBuf]| all.into_iter().find(|image| !paired.contains(image));
        let found = single(left, &lefts).map(|image| (image, cameras[1]));
        let found = found.or_else(|| single(right, &rights).map(|image| (image, cameras[0])));
        return Err(found
            .map_or_else(|| alone(&first, cameras[1]), |(image, other)| alone(&image, other))
            .into());
    }
    // Names without numbers are paired in order, which is no evidence.
    let same = |left: &Path, right: &Path| {
        let [left, right] = [left, right].map(files::stem);
        left == right || in_name(&left).iter().any(|number| in_name(&right).contains(number))
    };
    if let Some((left, _)) = lefts.iter().zip(&rights).find(|(left, right)| !same(left, right)) {
        return Err(alone(left, cameras[1]).into());
    }
    let mut names = Names::default();
    let mut rows = Vec::new();
    for (left, right) in lefts.iter().zip(&rights) {
        let name = files::stem(left);
        names.add(&name, 0).map_err(|reason| Error::read(left, reason))?;
        let [left, right] = [left, right].map(|image| shown(image.strip_prefix(dir).unwrap_or(image)));
        let calibration = Some(()).filter(|()| cameras != GREY).and_then(|()| calibration(dir, &name));
        let calibration = calibration.map(|file| shown(&file)).into_iter().collect();
        rows.push(Row::of_views(name, left, Some(right), calibration));
    }
    Ok(Some(rows))
}

/// The files in the folder `dir` that hold both views, in the order of their names.
fn of_both_views(dir: &Path) -> Result<Vec<Row>> {
    let entries = fs::read_dir(dir).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
    let mut found: Vec<_> =
        entries.map_err(|e| Error::read(dir, e))?.iter().map(fs::DirEntry::file_name).collect();
    found.retain(|file| holds_both(file.as_ref()) && !file.to_string_lossy().starts_with('.'));
    found.sort();
    let mut names = Names::default();
    let row = |file: OsString| {
        let name = files::stem(file.as_ref());
        names.add(&name, 0).map_err(|reason| Error::read(dir.join(&file), reason))?;
        Ok(Row::of_views(name, shown(file.as_ref()), None, Vec::new()))
    };
    found.into_iter().map(row).collect()
}

/// The calibration of the pair `name`: that of its scene, such as 000001 for `000001_10`, else that of all images in the folder `dir`.
fn calibration(dir: &Path, name: &str) -> Option<PathBuf> {
    let scene = name.split_once('_').map_or(name, |(scene, _)| scene);
    let own = CALIBRATIONS.map(|folder| Path::new(folder).join(format!("{scene}.txt")));
    own.into_iter().chain([CALIBRATION.into()]).find(|file| dir.join(file).is_file())
}
