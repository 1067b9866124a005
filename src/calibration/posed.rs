//! Cameras whose poses a file gives in a frame of the rig, such as that of an inertial sensor.

use super::cameras::{Pose, StereoCalibration};
use super::lens::Lens;
use super::matrix::length;
use super::node::Entry;
use crate::error::Result;
use crate::image::calib::Unit;

/// A camera of a rig.
pub(super) struct Posed<'a> {
    pub(super) lens: Lens,
    pub(super) size: Option<(usize, usize)>,
    /// From the frame of the rig to that of the camera.
    pub(super) pose: Pose,
    /// The entry of the pose.
    pub(super) entry: Entry<'a>,
}

/// The calibration of a pair of such cameras.
pub(super) fn pair(left: &Posed, right: &Posed, unit: Unit) -> Result<StereoCalibration> {
    let pose = Pose::between(&left.pose, &right.pose);
    apart(&right.entry, &pose)?;
    Ok(StereoCalibration {
        lenses: Some([left.lens, right.lens]),
        pose: Some(pose),
        size: left.size,
        right_size: right.size.filter(|size| Some(*size) != left.size),
        unit,
        ..StereoCalibration::default()
    })
}

/// An error about `entry` if both cameras are in one place.
pub(super) fn apart(entry: &Entry, pose: &Pose) -> Result<()> {
    if length(pose.translation) == 0.0 {
        return Err(entry.error("puts both cameras in one place; expected a translation other than 0"));
    }
    Ok(())
}
