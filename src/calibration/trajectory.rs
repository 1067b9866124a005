//! The way of a moving camera: its pose at each frame of a video.

use std::path::Path;

use super::cameras::Pose;
use super::matrix::{Matrix, nearest_rotation, of_quaternion};
use crate::error::{Error, Result};
use crate::text;

/// Largest file, in bytes.
const MOST_BYTES: u64 = 1 << 28;
/// The forms of a line, for error messages.
const FORMS: &str =
    "give 12 numbers as in KITTI's poses.txt, or time tx ty tz qx qy qz qw as in TUM's trajectories";

/// Reads the poses of a camera in the order of its frames: R X + T takes a point X from the frame of the camera into that of the world.
///
/// The file has a line for each frame: 12 numbers, the rows of R and T, as in KITTI's `poses.txt`, or 8 as in TUM's trajectories, the time,
/// T and a quaternion whose last number is its real part. Empty lines and comments (`#`) are skipped.
///
/// # Errors
/// [`Error::Read`] when the file cannot be read, or a line holds no pose.
pub fn read(file: &Path) -> Result<Vec<Pose>> {
    of_text(file, &String::from_utf8_lossy(&text::read(file, MOST_BYTES, "a list of poses")?))
}

/// Like [`read`], for a text in memory, which errors call `name`.
///
/// # Errors
/// The errors of [`read`].
pub fn of_text(name: &Path, text: &str) -> Result<Vec<Pose>> {
    let mut poses = Vec::new();
    for (i, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let is_between = |c: char| c.is_whitespace() || c == ',';
        let words: Vec<&str> = line.split(is_between).filter(|word| !word.is_empty()).collect();
        if words.first().is_none_or(|word| word.starts_with('#')) {
            continue;
        }
        let numbers: Option<Vec<f64>> = words.iter().map(|word| word.parse().ok()).collect();
        let numbers = numbers.filter(|numbers| numbers.iter().all(|v| v.is_finite()));
        let pose = match numbers.as_deref() {
            Some([_, x, y, z, qx, qy, qz, qw]) => of_quaternion([*qw, *qx, *qy, *qz])
                .map(|rotation| Pose { rotation, translation: [*x, *y, *z] }),
            Some(rows) if rows.len() == 12 => {
                let rotation: Matrix = std::array::from_fn(|y| std::array::from_fn(|x| rows[4 * y + x]));
                nearest_rotation(&rotation)
                    .map(|rotation| Pose { rotation, translation: [rows[3], rows[7], rows[11]] })
            }
            _ => None,
        };
        poses.push(pose.ok_or_else(|| Error::read(name, format!("line {}: no pose; {FORMS}", i + 1)))?);
    }
    if poses.is_empty() {
        return Err(Error::read(name, format!("holds no pose; {FORMS}")));
    }
    Ok(poses)
}

/// The motion from each pose to the next: it takes a point from the frame of the camera at one pose into that at the next. One fewer than
/// the poses.
#[must_use]
pub fn motions(poses: &[Pose]) -> Vec<Pose> {
    poses.windows(2).map(|two| two[0].then(&two[1].inverse())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> std::result::Result<Vec<Pose>, String> {
        of_text(Path::new("poses.txt"), text).map_err(|e| e.to_string())
    }

    #[test]
    fn both_forms_give_the_same_motions() {
        // A quarter turn about y between the frames, and a step along the x of the world.
        let kitti = of("1 0 0 1 0 1 0 2 0 0 1 3\n0 0 1 2 0 1 0 2 -1 0 0 3\n").unwrap();
        let half = 0.5_f64.sqrt();
        let tum =
            of(&format!("# time tx ty tz qx qy qz qw\n0.0 1 2 3 0 0 0 1\n\n0.1 2 2 3 0 {half} 0 {half}\n"))
                .unwrap();
        for poses in [kitti, tum] {
            let [motion] = motions(&poses)[..] else { panic!("two poses") };
            // A point in the centre of the second camera, and a point 1 to the right of it.
            for (point, expected) in [([1.0, 0.0, 0.0], [0.0; 3]), ([1.0, 0.0, -1.0], [1.0, 0.0, 0.0])] {
                let moved = motion.moved(point);
                assert!(moved.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{moved:?}");
            }
        }
    }

    #[test]
    fn other_lines_are_refused() {
        for (text, word) in [
            ("", "holds no pose"),
            ("1 0 0 0 0 1 0 0 0 0 1 0\n1 2 3\n", "line 2"),
            ("1 0 0 0 0 2 0 0 0 0 1 0", "line 1"),
            ("0 1 2 3 0 0 0 7", "line 1"),
            ("0 1 2 nan 0 0 0 1", "line 1"),
        ] {
            let error = of(text).unwrap_err();
            assert!(error.contains("poses.txt") && error.contains(word), "{text}: {error}");
        }
    }
}
