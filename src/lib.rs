//! Stereo disparity by a multi-resolution factor graph.

pub mod error;
pub mod evaluation;
pub mod image;

pub use error::{Error, Result};
