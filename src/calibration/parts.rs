//! A file for the lens of each camera, the left one first, and a file with their pose.

use super::cameras::{Pose, StereoCalibration};
use super::node::Entries;
use super::opencv;
use super::posed::{Posed, pair};
use crate::error::{Error, Result};

/// Reads the files together; `None` if none of them has the lens of a single camera or only a pose.
pub(super) fn read(files: &[Entries]) -> Option<Result<StereoCalibration>> {
    let lenses: Vec<&Entries> = files.iter().filter(|file| opencv::has_lens_alone(file)).collect();
    let poses: Vec<&Entries> = files.iter().filter(|file| opencv::has_pose(file)).collect();
    let wrong = |file: &Entries, reason: &str| Some(Err(Error::read(file.path(), reason)));
    if let Some(other) = files.iter().find(|file| !opencv::has_lens_alone(file) && !opencv::has_pose(file))
        && !lenses.is_empty()
    {
        return wrong(
            other,
            "does not belong to the other files: it has neither a lens nor R and T; leave it out",
        );
    }
    match (&lenses[..], &poses[..]) {
        ([], _) if files.iter().any(opencv::is) => None,
        ([], []) => None,
        ([], [pose, ..]) => wrong(
            pose,
            "says how the cameras stand, and there is no file of their lenses (K1, D1, K2, D2, or a file for each camera); give \
             these too",
        ),
        ([lens], []) => wrong(
            lens,
            "is of one camera; give the file of the other one too, and a file that says how the cameras stand (R and T)",
        ),
        ([lens], [..]) => wrong(lens, "is of one camera; give the file of the other one too"),
        ([_, right], []) => wrong(
            right,
            "is the second of two lenses, and no file says how the cameras stand; give a third one with R and T, from the left \
             camera to the right one",
        ),
        ([left, right], [pose]) => Some(of_parts(left, right, pose)),
        ([_, _], [_, pose, ..]) => {
            wrong(pose, "has R and T, and so has another file; keep those that are right")
        }
        ([_, _, third, ..], _) => {
            wrong(third, "is a third lens; give those of the left and the right camera")
        }
    }
}

fn of_parts(left: &Entries, right: &Entries, stand: &Entries) -> Result<StereoCalibration> {
    let posed = |camera: &Entries, pose: Pose| -> Result<Posed> {
        let entry = stand.require(opencv::TRANSLATION, "T", "that from the left camera to the right one")?;
        Ok(Posed { lens: opencv::lens_alone(camera)?, size: opencv::size(camera)?, pose, entry })
    };
    let unit = opencv::unit(stand)?;
    pair(&posed(left, Pose::IN_PLACE)?, &posed(right, opencv::pose(stand)?)?, unit)
}
