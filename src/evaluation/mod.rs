//! How far a disparity map is from the ground truth: the metrics, the truth they are taken against, where the errors
//! are, how good confidence and validity are, and the figures that the paper prints.
//!
//! Nothing here reads a file, prints, or knows how the map was made.

pub mod breakdown;
pub mod confidence;
pub mod dataset;
pub mod metrics;
pub mod paper;
pub mod validity;

pub use breakdown::Breakdown;
pub use confidence::Sparsification;
pub use dataset::GroundTruth;
pub use metrics::{Metrics, Report, THRESHOLDS, evaluate, mean, measure};
pub use validity::Detection;
