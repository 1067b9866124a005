//! Topics of ROS 2, live and without ROS: [`names`] resolves them as ROS does, and [`topics`] subscribes to them and publishes them over
//! DDS. Messages come and go in their bytes, which [`mrfgs_ros::messages`] takes apart and puts together. [`viewer`] shows topics to
//! Foxglove.

#![forbid(unsafe_code)]

pub mod names;
pub mod topics;
pub mod viewer;
