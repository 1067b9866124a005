//! Decides which of two images is the left one, if a calibration has the right camera on the left.

use super::matches;
use crate::calibration::cameras::StereoCalibration;
use crate::error::Result;
use crate::image::Pair;
use crate::maps::FRACTION;
use crate::rectification::{Options, Rectification};

impl Rectification {
    /// The rectification of the raw images of `pair` by a calibration, like [`Rectification::of_sizes`]. If the calibration
    /// has the right camera to the left of the left one, the matches decide whether the images are exchanged as well: only
    /// in one order are they on the same rows and in front of the cameras. Without matches the images keep their order.
    ///
    /// # Errors
    /// The errors of [`Rectification::new`]; [`Error::Memory`](crate::Error::Memory) if memory is too small.
    pub fn for_pair(calibration: &StereoCalibration, pair: &Pair, options: &Options) -> Result<Self> {
        let by = Self::of_sizes(calibration, pair.own_sizes(), options)?;
        if !by.has_exchanged_cameras() {
            return Ok(by);
        }
        let other = by.clone().with_images_exchanged();
        let rectified = by.apply(pair)?;
        if matches::check_memory(&rectified).is_err() {
            return Ok(by);
        }
        let infinite = -by.calibration()?.doffs.unwrap_or(0.0) * f64::from(FRACTION);
        let in_front = |rectified: &Pair| {
            let found = matches::find(rectified, None, None);
            found.iter().filter(|m| f64::from(m.disparity) >= infinite).count()
        };
        let as_given = in_front(&rectified);
        drop(rectified);
        Ok(if in_front(&other.apply(pair)?) > as_given { other } else { by })
    }
}
