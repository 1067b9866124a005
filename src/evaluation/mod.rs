//! Evaluation of disparity maps against the ground truth: error metrics, the ground truth itself, the error
//! breakdown, and the quality of confidence and validity.
//!
//! Nothing here reads a file, prints, or depends on how the map was made.

pub mod breakdown;
pub mod confidence;
pub mod dataset;
pub mod metrics;
pub mod validity;

pub use breakdown::Breakdown;
pub use confidence::Sparsification;
pub use dataset::GroundTruth;
pub use metrics::{Metrics, Report, THRESHOLDS, mean};
pub use validity::Detection;

#[cfg(test)]
mod cases {
    use super::GroundTruth;
    use crate::image::Plane;

    pub(super) fn row<T: Clone>(values: &[T]) -> Plane<T> {
        Plane::new(values.len(), 1, values.to_vec())
    }

    pub(super) fn ground(truth: &Plane<f32>, mask: Option<&Plane<u8>>) -> GroundTruth {
        GroundTruth::new(truth.clone(), mask.cloned()).unwrap()
    }

    #[track_caller]
    pub(super) fn close(got: impl Into<Option<f64>>, expected: f64) {
        let got = got.into().expect("a value");
        assert!((got - expected).abs() <= 1e-12 * expected.abs().max(1.0), "{got} instead of {expected}");
    }
}
