//! Outputs: all are checked before any computing, and all are written or none.

pub(crate) mod also;
mod also_args;
mod claim;
mod empty;
pub(crate) mod files;
mod film;
mod limits;
mod map_args;
pub(crate) mod messages;
mod outcome;
pub(crate) mod page;
mod record;
mod recording;
mod staged;
#[cfg_attr(not(feature = "live"), path = "viewer_without_live.rs")]
mod viewer;

pub(crate) use also::Also;
pub(crate) use also_args::AlsoArgs;
pub(crate) use claim::Claim;
pub(crate) use empty::{InFront, other_sign};
pub(crate) use files::{Written, is_printed};
pub(crate) use film::Film;
pub(crate) use map_args::{Format, MapArgs};
pub(crate) use messages::Cameras;
pub(crate) use outcome::{Outcome, View};
pub(crate) use page::Page;
pub(crate) use record::{Files, Found, MatchRecord, Tally, stage_and_level};
pub(crate) use recording::RecordedMaps;
pub(crate) use staged::StagedFolder;
pub(crate) use viewer::ShownMaps;
#[cfg(not(feature = "live"))]
pub(crate) use viewer::WITHOUT_LIVE;
