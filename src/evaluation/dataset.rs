//! The ground truth that a map is compared with.

use super::breakdown::{Breakdown, breakdown};
use super::confidence::{Sparsification, sparsify};
use super::metrics::{Report, evaluate, same_size};
use super::validity::{Detection, detect};
use crate::error::Result;
use crate::image::{Image, Plane};

/// The true disparities of a pair's reference view.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundTruth {
    truth: Plane<f32>,
    mask: Option<Plane<u8>>,
}

impl GroundTruth {
    /// The true disparities in pixels (not finite = unknown) and, where there is one, the visibility mask:
    /// 255 = both views see the pixel, anything else (128 occluded, 0 unknown) = not.
    ///
    /// # Errors
    /// [`Error::Mismatch`](crate::Error::Mismatch) when the two differ in size.
    pub fn new(truth: Plane<f32>, mask: Option<Plane<u8>>) -> Result<Self> {
        if let Some(mask) = &mask {
            same_size("mask", mask.size(), truth.size())?;
        }
        Ok(Self { truth, mask })
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

    /// The error metrics of `estimate` (not finite = invalid).
    ///
    /// # Errors
    /// [`Error::Mismatch`](crate::Error::Mismatch) when the sizes differ or no truth is known.
    pub fn evaluate(&self, estimate: &Plane<f32>) -> Result<Report> {
        evaluate(estimate, &self.truth, self.mask.as_ref())
    }

    /// The errors of `estimate` (not finite = invalid) by class; `reference` is the image of the reference
    /// view.
    ///
    /// # Errors
    /// As [`GroundTruth::evaluate`].
    pub fn breakdown(&self, estimate: &Plane<f32>, reference: &Image) -> Result<Breakdown> {
        breakdown(estimate, &self.truth, self.mask.as_ref(), reference)
    }

    /// How well `confidence` tells the bad pixels of `estimate` (not finite = invalid) from the good ones.
    ///
    /// # Errors
    /// As [`GroundTruth::evaluate`].
    pub fn sparsify(&self, estimate: &Plane<f32>, confidence: &Plane<u8>) -> Result<Sparsification> {
        sparsify(estimate, &self.truth, confidence)
    }

    /// How well the flags of a `validity` map detect the pixels that one view does not see; `None` without a
    /// mask.
    ///
    /// # Errors
    /// [`Error::Mismatch`](crate::Error::Mismatch) when the sizes differ.
    pub fn detect(&self, validity: &Plane<u8>) -> Result<Option<Detection>> {
        self.mask.as_ref().map(|mask| detect(validity, &self.truth, mask)).transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_compares_as_the_metrics_do() {
        let truth = Plane::new(2, 1, vec![1.0, 2.0]);
        let estimate = Plane::new(2, 1, vec![1.0, 4.0]);
        let mask = Plane::new(2, 1, vec![255, 128]);
        let ground = GroundTruth::new(truth.clone(), Some(mask.clone())).unwrap();
        let expected = evaluate(&estimate, &truth, Some(&mask)).unwrap();
        assert_eq!(ground.evaluate(&estimate).unwrap(), expected);
        assert_eq!(expected.nonocc.map(|m| m.pixels), Some(1));
    }

    #[test]
    fn a_mask_of_another_size_is_refused() {
        let error = GroundTruth::new(Plane::filled(3, 2, 0.0), Some(Plane::filled(2, 2, 255))).unwrap_err();
        assert!(error.to_string().contains("mask is 2 x 2"), "{error}");
    }
}
