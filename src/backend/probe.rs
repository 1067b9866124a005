//! What only tests and diagnosis need of a backend: its volumes and maps value by value.

use super::{Backend, Map};
use crate::error::Result;
use crate::image::Plane;
use crate::plan::Plan;

/// A volume, in the layout \[y\]\[x\]\[slot\]\[label\] (slot only
/// for dependency messages), unpadded, one value an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Volume {
    /// Matching cost: in cost units at level 0, in 1/256 cost units at coarser levels.
    Cost(usize),
    /// Evidence e.
    Evidence(usize),
    /// Messages of the dependency factors to their members.
    Dependency(usize),
    /// Messages of the resolution factors above to the pixels of this level.
    Down(usize),
    /// Messages of the resolution factors of this level to their own, coarse pixel.
    Up(usize),
    /// Beliefs b.
    Belief(usize),
}

impl Volume {
    /// The level it belongs to.
    #[must_use]
    pub fn level(self) -> usize {
        match self {
            Self::Cost(z)
            | Self::Evidence(z)
            | Self::Dependency(z)
            | Self::Down(z)
            | Self::Up(z)
            | Self::Belief(z) => z,
        }
    }
}

/// A look into a backend between two stages, at the price of time. The methods fail as those of [`Backend`] do.
#[allow(clippy::missing_errors_doc, reason = "said once, above")]
pub trait Probe: Backend {
    /// The values of `volume`.
    fn read(&mut self, volume: Volume) -> Result<Vec<u32>>;

    /// Replaces the values of `volume`.
    fn write(&mut self, volume: Volume, values: &[u32]) -> Result<()>;

    /// Replaces the values of `map`.
    fn write_map(&mut self, map: Map, values: &Plane<i32>) -> Result<()>;

    /// Overwrites every buffer with `byte`. A later match of the same plan shows it wherever it reads what it did not write.
    fn poison(&mut self, byte: u8) -> Result<()>;
}

/// Number of values in `volume` under `plan`, and labels in a row of them, without and with padding.
#[must_use]
pub fn volume_shape(plan: &Plan, volume: Volume) -> (usize, usize, usize) {
    let rows = if matches!(volume, Volume::Dependency(_)) { plan.slots() } else { 1 };
    let level = &plan.levels[volume.level()];
    (level.pixels() * rows, level.labels, level.stride)
}

/// Values for a volume, as rows of labels to be stored with padding.
pub(super) struct PaddedRows<'a> {
    values: &'a [u32],
    labels: usize,
    stride: usize,
    /// The padding is at least this, and a row's largest value.
    least: u32,
}

impl<'a> PaddedRows<'a> {
    pub(super) fn new(plan: &Plan, volume: Volume, values: &'a [u32]) -> Self {
        let (rows, labels, stride) = volume_shape(plan, volume);
        assert_eq!(values.len(), rows * labels, "values of {volume:?}");
        // Padding must never look better than a label, also after a message is taken off a belief.
        let least = match volume {
            Volume::Belief(_) => plan.volume_width.most().into(),
            _ => 0,
        };
        Self { values, labels, stride, least }
    }

    /// Rows of `stride` values each.
    pub(super) fn iter(&self) -> impl Iterator<Item = Vec<u32>> {
        self.values.chunks_exact(self.labels).map(|row| {
            let padding = row.iter().copied().max().unwrap_or(0).max(self.least);
            let mut row = row.to_vec();
            row.resize(self.stride, padding);
            row
        })
    }

    pub(super) fn fill<T>(&self, out: &mut [T], convert: impl Fn(u32) -> T) {
        for (out, row) in out.chunks_exact_mut(self.stride).zip(self.iter()) {
            for (out, value) in out.iter_mut().zip(row) {
                *out = convert(value);
            }
        }
    }
}
