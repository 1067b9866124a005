//! The calibration of RealSense cameras, saved as JSON by their viewer: that of the rectified views, at each
//! image size.

use super::cameras::{RectifiedViews, StereoCalibration};
use super::node::Entries;
use crate::error::Result;
use crate::image::calib::{Camera, Unit};

/// More than the image sizes of a camera, whose numbers may have gaps.
const MOST_SIZES: usize = 64;

/// Whether the file is RealSense's.
pub(super) fn is(entries: &Entries) -> bool {
    entries.find("baseline").is_some() && entries.find("rectified.0.fx").is_some()
}

pub(super) fn read(entries: &Entries) -> Result<StereoCalibration> {
    let expected = "a number of millimetres other than 0";
    let entry = entries.require("baseline", "baseline", expected)?;
    // The viewer writes it with the sign of T.
    let baseline =
        entry.number().map(f64::abs).ok().filter(|v| *v > 0.0).ok_or_else(|| entry.wrong(expected))?;
    let mut sizes = Vec::new();
    for i in 0..MOST_SIZES {
        let name = |end: &str| format!("rectified.{i}.{end}");
        let Some(width) = entries.find(&name("width")) else { continue };
        let number = |end: &str| entries.number(&name(end), &name(end));
        // Sizes that the camera lacks have no width or no focal length.
        if width.number()? == 0.0 || number("fx")? == 0.0 {
            continue;
        }
        let height = entries.require(&name("height"), &name("height"), "a number of pixels")?;
        let above_0 = |end: &str| entries.above_0(&name(end), &name(end));
        let camera = Camera {
            focal_length: [above_0("fx")?, above_0("fy")?],
            principal_point: [number("ppx")?, number("ppy")?],
        };
        sizes.push(StereoCalibration {
            views: Some(RectifiedViews::of_rectified(camera, baseline)),
            size: Some((width.count()?, height.count()?)),
            unit: Unit::Millimetre,
            ..StereoCalibration::default()
        });
    }
    StereoCalibration::of_sizes(sizes)
        .ok_or_else(|| entry.error("stands without a size of images; save the file again"))
}
