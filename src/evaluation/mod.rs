//! How far a disparity map is from the ground truth: the metrics, the truth they are taken against, the table that
//! shows them, and the figures that the paper prints.
//!
//! Nothing here reads a file, prints, or knows how the map was made.

pub mod dataset;
pub mod metrics;
pub mod paper;
pub mod table;

pub use dataset::GroundTruth;
pub use metrics::{Metrics, Report, THRESHOLDS, evaluate, mean, measure};
pub use table::{Row, table};
