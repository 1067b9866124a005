//! What ROS records of a pair of cameras, for mrfgs: images, calibrations, disparities, depths and points.
//!
//! [`messages`] has the types of ROS that matter here, in the bytes in which ROS 1 and ROS 2 pass them on. [`pixels`] makes an image of the
//! library of one of ROS. [`topics`] and [`pairing`] find out which images are pairs. [`recording`] reads MCAP files and bags, and writes
//! MCAP files. Nothing here knows where messages come from: they may be live.

#![forbid(unsafe_code)]

pub mod messages;
pub mod pairing;
pub mod pixels;
pub mod recording;
pub mod topics;
