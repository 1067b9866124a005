//! Options of a rectification.

use crate::error::{Error, Result};

/// Options of a rectification. The defaults are those of OpenCV's `stereoRectify`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// From 0, where every pixel of the rectified views has a source, to 1, where no pixel of the images is lost. `None`
    /// keeps the focal length; for fisheyes it means 0. A number overrides a rectification that the calibration holds.
    pub alpha: Option<f64>,
    /// Whether both views share a principal point, so that points at infinity have a disparity of 0.
    pub zero_disparity: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { alpha: None, zero_disparity: true }
    }
}

impl Options {
    pub(super) fn check(&self) -> Result<()> {
        match self.alpha {
            Some(alpha) if !(0.0..=1.0).contains(&alpha) => Err(Error::Calibration(format!(
                "can be rectified with an alpha from 0 to 1, not with {alpha}"
            ))),
            _ => Ok(()),
        }
    }
}
