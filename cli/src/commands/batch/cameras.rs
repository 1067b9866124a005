//! Folders with the images of each camera in a folder, as KITTI has them.

use std::path::{Path, PathBuf};

use mrfgs::Error;

use crate::failure::Result;
use crate::pairs::folder::{CALIBRATION, Folder};
use crate::pairs::list::{Names, Row};
use crate::sequences::{Pairing, files, pair};

use super::listed::shown;

/// KITTI's folders of grey images, whose cameras are not those that its calibrations are read for.
const GREY: [&str; 2] = ["image_0", "image_1"];

/// The folders of the left and the right images. A folder with several of these has the first.
const FOLDERS: [[&str; 2]; 4] = [["left", "right"], ["image_2", "image_3"], ["colored_0", "colored_1"], GREY];

/// Folders with a calibration for each scene of KITTI: 2015 and 2012.
const CALIBRATIONS: [&str; 2] = ["calib_cam_to_cam", "calib"];

/// The pairs in the folder `dir`, with paths relative to it; `None` if it has not the folders of two cameras.
///
/// # Errors
/// If an image has no partner, or a name is unfit for a pair.
pub(super) fn pairs(dir: &Path) -> Result<Option<Vec<Row>>> {
    let holds = |name: &str| dir.join(name).is_dir() && Folder::to_match(&dir.join(name)).is_err();
    let Some(cameras) = FOLDERS.into_iter().find(|names| names.iter().all(|name| holds(name))) else {
        return Ok(None);
    };
    let [left, right] = cameras.map(|name| files::list(&dir.join(name)));
    let (Some(left), Some(right)) = (left?, right?) else { return Ok(None) };
    let of_all = left.len() + right.len();
    let first = left[0].clone();
    let alone = |image: &Path, other: &str| {
        let reason =
            format!("has no partner with its number in {other}; add it, or list the pairs in a CSV file");
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
    let mut names = Names::default();
    let mut rows = Vec::new();
    for (left, right) in lefts.iter().zip(&rights) {
        let name = files::stem(left);
        names.add(&name, 0).map_err(|reason| Error::read(left, reason))?;
        let views = [left, right].map(|image| shown(image.strip_prefix(dir).unwrap_or(image)));
        let calibration = Some(()).filter(|()| cameras != GREY).and_then(|()| calibration(dir, &name));
        let calibration = calibration.map(|file| shown(&file)).into_iter().collect();
        rows.push(Row::of_views(name, views, calibration));
    }
    Ok(Some(rows))
}

/// The calibration of the pair `name`: that of its scene, such as 000001 for `000001_10`, else that of all images in the folder `dir`.
fn calibration(dir: &Path, name: &str) -> Option<PathBuf> {
    let scene = name.split_once('_').map_or(name, |(scene, _)| scene);
    let own = CALIBRATIONS.map(|folder| Path::new(folder).join(format!("{scene}.txt")));
    own.into_iter().chain([CALIBRATION.into()]).find(|file| dir.join(file).is_file())
}
