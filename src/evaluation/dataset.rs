//! The ground truth that a map is compared with.

use crate::error::{Error, Result};
use crate::image::Plane;

/// The true disparities of a pair's reference view. Each kind of comparison with them is in a file of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundTruth {
    pub(super) truth: Plane<f32>,
    pub(super) mask: Option<Plane<u8>>,
}

impl GroundTruth {
    /// The true disparities in pixels (not finite = unknown) and, where there is one, the visibility mask:
    /// 255 = both views see the pixel, anything else (128 occluded, 0 unknown) = not.
    ///
    /// # Errors
    /// [`Error::Mismatch`] when the two differ in size.
    pub fn new(truth: Plane<f32>, mask: Option<Plane<u8>>) -> Result<Self> {
        if let Some(mask) = &mask {
            same_size("mask", mask.size(), truth.size())?;
        }
        Ok(Self { truth, mask })
    }

    /// The ground truth with every known disparity rounded to the nearest whole pixel, ties away from 0.
    ///
    /// Programs that divide an 8-bit map by its scale in integers compare with such a truth: MATLAB does so with `uint8`.
    #[must_use]
    pub fn rounded(&self) -> Self {
        Self { truth: self.truth.map(|d| d.round()), mask: self.mask.clone() }
    }

    /// The true disparities, not finite where unknown.
    #[must_use]
    pub fn truth(&self) -> &Plane<f32> {
        &self.truth
    }

    /// The mask: 255 where both views see the pixel.
    #[must_use]
    pub fn mask(&self) -> Option<&Plane<u8>> {
        self.mask.as_ref()
    }
}

/// Checks that all planes of a comparison have one size.
pub(super) fn same_size(what: &str, got: (usize, usize), truth: (usize, usize)) -> Result<()> {
    if got == truth {
        return Ok(());
    }
    Err(Error::Mismatch(format!(
        "the {what} is {} x {} and the ground truth {} x {}: both must be of the reference view, at one resolution",
        got.0, got.1, truth.0, truth.1
    )))
}
