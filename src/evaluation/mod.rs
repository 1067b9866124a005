//! How far a disparity map is from the ground truth: the metrics, and the truth they are taken against.
//!
//! Nothing here reads a file, prints, or knows how the map was made.

pub mod dataset;
pub mod metrics;

pub use dataset::GroundTruth;
pub use metrics::{Metrics, Report, THRESHOLDS, evaluate, mean, measure};
