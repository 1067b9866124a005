//! Live ROS 2 topics without ROS: [`names`] resolves topic names as ROS does, [`topics`] subscribes and publishes over DDS, with messages
//! in the serialization of [`mrfgs_ros::messages`], and [`viewer`] shows topics to Foxglove.

#![forbid(unsafe_code)]

pub mod names;
pub mod topics;
pub mod viewer;
