//! The options of a match: [`Method`] holds all that determine the maps, [`Execution`] those that do not.
//!
//! The options of a method are in groups, one file each. An option is one row in the file of its group: its
//! field, validation, listing and documentation follow from the row (see [`Key`]). Presets that differ from
//! the row's default say so in `presets.rs`.
//!
//! A [`Method`] is read from TOML or set key by key. No two groups share a key, so both `sad-window` and
//! `cost.sad-window` are accepted.
//!
//! Sections are those of Shabanian and Balasubramanian, *Multi-Resolution Factor Graph Based Stereo Correspondence
//! Algorithm*; "open" means that the paper leaves the choice open.

mod cost;
mod execution;
mod front;
mod graph;
mod messages;
mod method;
mod presets;
mod range;
#[cfg(feature = "files")]
mod read;
mod refinement;
mod row;
mod schedule;
mod tiles;

pub use cost::{CostFacts, CostOptions, MatchingCost, Pyramid};
pub use execution::{DeviceChoice, Execution};
pub use front::FrontOptions;
#[cfg(feature = "paper")]
pub use front::{Illumination, ZoneExtent};
pub use graph::GraphOptions;
pub use messages::{Agreement, MessageOptions, Potential};
pub use method::{GROUPS, Method};
pub use presets::{PRESETS, Preset};
pub use range::{DisparityRange, MAX_DISPARITY, MAX_LABELS};
pub use refinement::{Fill, LeftRightCheck, Median, Nearer, RefinementOptions};
pub use row::{Group, Key, Takes, Word};
pub use schedule::{MatchSize, Order, ScheduleOptions};
pub use tiles::{MAX_MEMORY, TileOptions, mebibytes};
