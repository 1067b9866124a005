//! How far a disparity map is from the ground truth: the metrics, the truth they are taken against, where the errors
//! are, what confidence and validity are worth, the table that shows the metrics, and the figures that the paper prints.
//!
//! Nothing here reads a file, prints, or knows how the map was made.

pub mod breakdown;
pub mod confidence;
pub mod dataset;
pub mod metrics;
pub mod paper;
pub mod table;
pub mod validity;

pub use breakdown::Breakdown;
pub use confidence::Sparsification;
pub use dataset::GroundTruth;
pub use metrics::{Metrics, Report, THRESHOLDS, evaluate, mean, measure};
pub use table::{Row, table};
pub use validity::Detection;
