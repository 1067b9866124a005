//! EuRoC's `sensor.yaml`, one file for each camera, the left one first.

use super::cameras::StereoCalibration;
use super::kalibr;
use super::node::Entries;
use super::posed::{Posed, pair};
use crate::error::Result;
use crate::image::calib::Unit;

/// Whether the file is of one camera.
pub(super) fn is(entries: &Entries) -> bool {
    entries.find("tbs").is_some()
}

pub(super) fn read(cameras: [&Entries; 2]) -> Result<StereoCalibration> {
    let [left, right] = cameras.map(camera);
    pair(&left?, &right?, Unit::Metre)
}

fn camera<'a>(entries: &Entries<'a>) -> Result<Posed<'a>> {
    let entry = entries.require("tbs", "T_BS", "a matrix of 4 x 4 from the camera to the body")?;
    let (lens, size) = (kalibr::lens(entries)?, Some(kalibr::size(entries)?));
    Ok(Posed { lens, size, pose: entry.pose()?.inverse(), entry })
}
