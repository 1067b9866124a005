//! The commands of `mrfgs`, one file or folder each.

pub(crate) mod batch;
pub(crate) mod bench;
pub(crate) mod completions;
pub(crate) mod demo;
pub(crate) mod depth;
pub(crate) mod devices;
pub(crate) mod evaluate;
pub(crate) mod inspect;
pub(crate) mod man;
pub(crate) mod r#match;
pub(crate) mod presets;
pub(crate) mod rectify;
#[cfg_attr(not(feature = "live"), path = "ros_without_live.rs")]
pub(crate) mod ros;
pub(crate) mod sequence;
pub(crate) mod view;
