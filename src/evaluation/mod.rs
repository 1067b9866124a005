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
pub use metrics::{Metrics, Report, THRESHOLDS, evaluate, mean, measure};
pub use validity::Detection;
