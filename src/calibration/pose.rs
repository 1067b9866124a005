//! The left camera's pose in a frame of other measurements, such as that of a lidar or of a reconstruction.

use std::path::Path;

use super::cameras::Pose;
use super::matrix::{Matrix, nearest_rotation};
use super::node::{Entries, Entry};
use super::{colmap, opencv, root, text};
use crate::error::{Error, Result};

/// What a file may hold, for messages.
const FORMS: &str =
    "give a matrix of 3 x 4 or 4 x 4 numbers, R and T, KITTI's Tr_velo_to_cam or COLMAP's images.txt";
/// KITTI's names for the pose of a lidar, as [`Entries::find`] takes them.
const LIDAR: &str = "trvelotocam trvelocam tr";
/// KITTI's rotation from the camera to the rectified camera.
const RECTIFYING: &str = "r0rect rrect";

/// Reads the transformation R X + T of points X into the frame of the left camera: x to the right, y down, z forward.
///
/// The file holds 12 or 16 numbers (the rows of R and T, and 0 0 0 1), entries `R` and `T` (`T` alone as a matrix of 4 x 4) in YAML, JSON
/// or as in KITTI's `calib_velo_to_cam.txt`, KITTI's `Tr_velo_to_cam` or `Tr`, or COLMAP's `images.txt`, whose first image is the left one.
/// T has the unit of the points.
///
/// # Errors
/// [`Error::Read`] when the file cannot be read or holds none of these, or R is no rotation.
pub fn read(file: &Path) -> Result<Pose> {
    of_text(file, &text(file)?)
}

/// Like [`read`], for a text in memory, which errors call `name`.
///
/// # Errors
/// The errors of [`read`].
pub fn of_text(name: &Path, text: &str) -> Result<Pose> {
    if let Some(pose) = of_numbers(text) {
        return pose.map_err(|reason| Error::read(name, reason));
    }
    let root = root(name, text).map_err(|_| Error::read(name, format!("holds no pose; {FORMS}")))?;
    let entries = Entries::new(vec![(name, &root)]);
    if let Some(images) = colmap::first_image(&entries) {
        return images;
    }
    if let Some(entry) = entries.find(LIDAR) {
        let [a, b, c] = entry.matrix::<3, 4>()?;
        let rotation = entry.rotation(&[a, b, c].map(|row| [row[0], row[1], row[2]]))?;
        let pose = Pose { rotation, translation: [a[3], b[3], c[3]] };
        let rectifying = entries.find(RECTIFYING).map(|entry: Entry| entry.rotation(&entry.matrix()?));
        return Ok(match rectifying.transpose()? {
            Some(rotation) => pose.then(&Pose { rotation, translation: [0.0; 3] }),
            None => pose,
        });
    }
    if entries.find(opencv::TRANSLATION).is_none() {
        return Err(Error::read(name, format!("holds no pose; {FORMS}")));
    }
    let rotation = "the rotation of the points into the frame of the left camera";
    of_entries(&entries, rotation, "3 numbers, the origin of the points in the frame of the left camera")
}

/// A pose in the entries R and T, or T alone as a matrix of 4 x 4. Errors describe R as `rotation` and T as `translation`.
pub(super) fn of_entries(entries: &Entries, rotation: &str, translation: &str) -> Result<Pose> {
    let found = entries.require(opencv::TRANSLATION, "T", translation)?;
    if entries.find(opencv::ROTATION).is_none() && found.numbers::<16>(translation).is_ok() {
        return found.pose();
    }
    Ok(Pose { rotation: opencv::rotation_of(entries, rotation)?, translation: found.numbers(translation)? })
}

/// The pose in a text of nothing but 12 or 16 numbers; `None` for any other text.
fn of_numbers(text: &str) -> Option<std::result::Result<Pose, &'static str>> {
    let is_between = |c: char| c.is_whitespace() || [',', ';', '[', ']'].contains(&c);
    let words = text.split(is_between).filter(|word| !word.is_empty());
    let numbers: Vec<f64> = words.map(|word| word.parse().ok()).collect::<Option<_>>()?;
    let rows = match numbers[..] {
        [ref rows @ .., 0.0, 0.0, 0.0, 1.0] | ref rows if rows.len() == 12 => rows,
        _ => return Some(Err(FORMS)),
    };
    let rotation: Matrix = std::array::from_fn(|y| std::array::from_fn(|x| rows[4 * y + x]));
    let translation = [rows[3], rows[7], rows[11]];
    let rotation = nearest_rotation(&rotation).filter(|_| translation.iter().all(|v| v.is_finite()));
    Some(
        rotation
            .map(|rotation| Pose { rotation, translation })
            .ok_or("the first three columns are no rotation, whose rows are at right angles and of length 1"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> std::result::Result<Pose, String> {
        of_text(Path::new("pose.txt"), text).map_err(|e| e.to_string())
    }

    /// A lidar's x forward, y left, z up.
    const TURN: Matrix = [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]];

    #[test]
    fn all_forms_give_the_same_pose() {
        let pose = Pose { rotation: TURN, translation: [0.5, -0.25, 2.0] };
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
        for text in [
            "0 -1 0 0.5\n0 0 -1 -0.25\n1 0 0 2\n",
            "[[0, -1, 0, 0.5], [0, 0, -1, -0.25], [1, 0, 0, 2], [0, 0, 0, 1]]",
            "calib_time: 15-Mar-2012 11:37:16\nR: 0 -1 0 0 0 -1 1 0 0\nT: 0.5 -0.25 2\n",
            "R: [0, -1, 0, 0, 0, -1, 1, 0, 0]\nT: [0.5, -0.25, 2]\n",
            "P0: 1 0 0 0 0 1 0 0 0 0 1 0\nTr_velo_to_cam: 0 -1 0 0.5 0 0 -1 -0.25 1 0 0 2\n",
            "P0: 1 0 0 0 0 1 0 0 0 0 1 0\nTr: 0 -1 0 0.5 0 0 -1 -0.25 1 0 0 2\n",
            "# Image list\n4 0.5 0.5 -0.5 0.5 0.5 -0.25 2 1 l.png\n1 2 -1\n5 1 0 0 0 0 0 0 1 r.png\n\n",
        ] {
            let found = of(text).unwrap_or_else(|e| panic!("{text}: {e}"));
            assert!(close(found.rotation.as_flattened(), pose.rotation.as_flattened()), "{text}: {found:?}");
            assert!(close(&found.translation, &pose.translation), "{text}: {found:?}");
        }
        // A half turn of the rectified camera about its axis comes after the pose.
        let text = "R0_rect: -1 0 0 0 -1 0 0 0 1\nTr_velo_to_cam: 0 -1 0 0.5 0 0 -1 -0.25 1 0 0 2\n";
        assert!(close(&of(text).unwrap().translation, &[-0.5, 0.25, 2.0]));
    }

    #[test]
    fn other_files_are_refused() {
        for (text, word) in [
            ("1 2 3", "3 x 4"),
            ("1 0 0 0 0 2 0 0 0 0 1 0", "rotation"),
            ("1 0 0 nan 0 1 0 0 0 0 1 0", "rotation"),
            ("R: 1 2 3 4\nT: 1 2 3", "R"),
            ("R: 1 0 0 0 1 0 0 0 1\nT: 1 2", "T"),
            ("", "3 x 4"),
            ("focal: 3", "Tr_velo_to_cam"),
        ] {
            let error = of(text).unwrap_err();
            assert!(error.contains("pose.txt") && error.contains(word), "{text}: {error}");
        }
    }
}
