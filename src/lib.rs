//! Stereo disparity by a multi-resolution factor graph.

pub mod backend;
pub mod error;
pub mod evaluation;
pub mod graph;
pub mod image;
mod matcher;
pub mod options;
pub mod plan;
pub mod refine;
pub mod solver;
pub mod tables;

pub use error::{Error, Result};
pub use matcher::{Matched, match_pair};
