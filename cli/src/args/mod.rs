//! Groups of flags that several commands share.

mod cameras;
mod execution;
mod method;
mod prior;
mod reading;
pub(crate) mod recording;
mod rectification;
mod region;
pub(crate) mod search;
mod shard;
mod sign;

pub(crate) use cameras::{CameraArgs, CameraNeed, above_zero};
pub(crate) use execution::{ExecutionArgs, ThreadArgs};
pub(crate) use method::MethodArgs;
#[cfg(feature = "live")]
pub(crate) use prior::POSE;
pub(crate) use prior::{
    CloudPoints, CloudPose, PRIOR_TOPIC, PriorArgs, PriorFile, PriorNames, PriorTopicArgs, PriorView, Way,
};
pub use prior::{Kind as PriorKind, LengthUnit};
pub(crate) use reading::{ReadingArgs, disparity, scale};
pub(crate) use recording::{RecordingArgs, Topics};
pub(crate) use rectification::{RectificationArgs, shown};
pub(crate) use region::{BlockArgs, CropArgs, RegionArgs};
pub(crate) use search::{ResolvedRange, Search, calibrated_range, depth};
pub(crate) use shard::{Shard, shard};
pub(crate) use sign::Sign;
