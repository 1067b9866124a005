//! ROS messages of stereo cameras for mrfgs: images, calibrations, disparities, depths and points.
//!
//! [`messages`] has the relevant message types in the serializations of ROS 1 and ROS 2. [`pixels`] converts ROS images to the library's.
//! [`topics`] and [`pairing`] find pairs of topics and of images. [`recording`] reads MCAP files and bags, and writes MCAP files. Apart
//! from that, messages may come from a recording or a live source.

#![forbid(unsafe_code)]

pub mod messages;
pub mod pairing;
pub mod pixels;
pub mod recording;
pub mod topics;
