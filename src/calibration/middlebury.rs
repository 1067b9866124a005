//! Middlebury's `calib.txt` as a calibration of two cameras.

use std::path::Path;

use super::cameras::{Pose, RectifiedViews, StereoCalibration};
use super::lens::{Distortion, Lens};
use super::matrix::IDENTITY;
use crate::error::Result;
use crate::image::calib::{Calibration, Camera};

/// Whether a text is meant to be such a file.
pub(super) fn is(text: &str) -> bool {
    Calibration::is_meant(text)
}

pub(super) fn of_text(path: &Path, text: &str) -> Result<StereoCalibration> {
    let benchmark = Calibration::of_text(path, text)?;
    let mut calibration = StereoCalibration { unit: benchmark.unit, ..StereoCalibration::default() };
    if let (Some(width), Some(height)) = (benchmark.width, benchmark.height) {
        calibration.size = Some((width as usize, height as usize));
    }
    if let Some(([left, right], baseline)) = benchmark.cameras()
        && baseline > 0.0
    {
        let lens = |camera: Camera| Lens::new(camera.focal_length, camera.principal_point, Distortion::NONE);
        calibration.lenses = Some([lens(left)?, lens(right)?]);
        calibration.pose = Some(Pose { rotation: IDENTITY, translation: [-baseline, 0.0, 0.0] });
        calibration.views = Some(RectifiedViews {
            rotations: [IDENTITY; 2],
            cameras: [left, right],
            translation: [-baseline, 0.0],
            size: None,
        });
    }
    calibration.benchmark = Some(benchmark);
    Ok(calibration)
}
