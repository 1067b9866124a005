//! ROS messages with images, calibrations, disparities and points.
//!
//! They are decoded from CDR of ROS 2 (either byte order) and from ROS 1, and encoded as CDR.

mod basics;
mod bytes;
mod definitions;
mod graph;
mod scan;
mod types;

pub use basics::{Encoding, Result, SECOND, Stamp};
pub use definitions::definition;
pub use graph::{Gid, NodeEntitiesInfo, ParticipantEntitiesInfo};
pub use scan::Scan;
pub use types::{
    CameraInfo, CompressedImage, DisparityImage, Encode, FLOAT32, FLOAT64, Header, Image, PointCloud2,
    PointField, RegionOfInterest, Type, UINT8,
};

#[cfg(test)]
mod tests;
