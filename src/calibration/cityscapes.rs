//! The `camera.json` of Cityscapes, for a rectified pair.

use super::cameras::{RectifiedViews, StereoCalibration};
use super::node::Entries;
use crate::error::Result;
use crate::image::calib::{Camera, Unit};

/// Whether the file is Cityscapes's.
pub(super) fn is(entries: &Entries) -> bool {
    let has = |group: &str, name: &str| {
        let group = entries.find(group).and_then(|entry| entry.group().ok());
        group.is_some_and(|group| group.find(name).is_some())
    };
    has("extrinsic", "baseline") && has("intrinsic", "u0")
}

pub(super) fn read(entries: &Entries) -> Result<StereoCalibration> {
    let extrinsic = entries.require("extrinsic", "extrinsic", "the baseline")?.group()?;
    let intrinsic = entries.require("intrinsic", "intrinsic", "fx, fy, u0 and v0")?.group()?;
    let above_0 = |name: &str| intrinsic.above_0(name, name);
    let camera = Camera {
        focal_length: [above_0("fx")?, above_0("fy")?],
        principal_point: [intrinsic.number("u0", "u0")?, intrinsic.number("v0", "v0")?],
    };
    let views = RectifiedViews::of_rectified(camera, extrinsic.above_0("baseline", "baseline")?);
    Ok(StereoCalibration { views: Some(views), unit: Unit::Metre, ..StereoCalibration::default() })
}
