//! Access for tests and diagnosis: volumes and maps value by value.

use crate::error::Result;
use crate::graph::LevelGraph;
use crate::image::Plane;
use crate::stage::{Map, Volume};

/// Reads and writes the data of a backend between two stages; this is slow. The methods fail with
/// [`crate::Error::Device`] if the device fails.
#[allow(clippy::missing_errors_doc, reason = "said once, above")]
pub trait Probe {
    /// The values of `volume`. Outside the pixel's window, beliefs are infinity and messages the truncation.
    fn read(&mut self, volume: Volume) -> Result<Vec<u32>>;

    /// Replaces the values of `volume`.
    fn write(&mut self, volume: Volume, values: &[u32]) -> Result<()>;

    /// The label windows of `level`, as [`Stage::LabelWindow`](super::Stage::LabelWindow) defines them: first
    /// label and number of labels with padding, for each run in each row of windows.
    fn windows(&mut self, level: usize) -> Result<Plane<[u16; 2]>>;

    /// Replaces the label windows of `level`; the contents of its volumes become undefined.
    fn set_windows(&mut self, level: usize, windows: &Plane<[u16; 2]>) -> Result<()>;

    /// The sum of the last [`Stage::Change`](super::Stage::Change).
    fn change(&mut self) -> Result<u64>;

    /// The graph of `level`.
    fn graph(&mut self, level: usize) -> Result<LevelGraph>;

    /// Replaces the graph of `level`.
    fn set_graph(&mut self, level: usize, graph: &LevelGraph) -> Result<()>;

    /// Replaces the values of `map`.
    fn write_map(&mut self, map: Map, values: &Plane<i32>) -> Result<()>;

    /// Overwrites everything that a match writes with `byte`, to reveal reads of unwritten data in later matches of the plan.
    fn poison(&mut self, byte: u8) -> Result<()>;
}
