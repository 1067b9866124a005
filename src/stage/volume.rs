//! The volumes of a match.

use crate::plan::Plan;

/// A volume, in the unpadded layout \[y\]\[x\]\[slot\]\[label\] (slot only for dependency messages).
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
    /// Whether a match with `levels` levels has it: the finest has no messages from below, the coarsest none from above.
    #[must_use]
    pub fn is_there(self, levels: usize) -> bool {
        match self {
            Self::Down(z) => z + 1 < levels,
            Self::Up(z) => z > 0,
            other => other.level() < levels,
        }
    }

    /// Bytes per stored value.
    #[must_use]
    pub fn bytes(self, plan: &Plan) -> usize {
        match self {
            Self::Cost(0) | Self::Evidence(_) => 1,
            Self::Cost(_) => 2,
            _ => plan.volume_width.bytes(),
        }
    }

    /// The level that it belongs to.
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

/// (rows of labels, labels per row, labels per row with padding) of `volume`.
#[must_use]
pub fn volume_shape(plan: &Plan, volume: Volume) -> (usize, usize, usize) {
    let rows = if matches!(volume, Volume::Dependency(_)) { plan.slots() } else { 1 };
    let level = &plan.levels[volume.level()];
    (level.pixels() * rows, level.labels, level.stride)
}

/// Values of a volume as rows of labels, for storage with padding.
pub(crate) struct PaddedRows<'a> {
    values: &'a [u32],
    labels: usize,
    stride: usize,
    /// Lower bound of the padding, which is also at least the largest value of the row.
    least: u32,
}

impl<'a> PaddedRows<'a> {
    pub(crate) fn new(plan: &Plan, volume: Volume, values: &'a [u32]) -> Self {
        let (rows, labels, stride) = volume_shape(plan, volume);
        assert_eq!(values.len(), rows * labels, "values of {volume:?}");
        // Padding must never be better than a label, even after a message is subtracted from a belief.
        let least = match volume {
            Volume::Belief(_) => plan.volume_width.most().into(),
            _ => 0,
        };
        Self { values, labels, stride, least }
    }

    /// Rows of `stride` values each.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Vec<u32>> {
        self.values.chunks_exact(self.labels).map(|row| {
            let padding = row.iter().copied().max().unwrap_or(0).max(self.least);
            let mut row = row.to_vec();
            row.resize(self.stride, padding);
            row
        })
    }

    pub(crate) fn fill<T>(&self, out: &mut [T], convert: impl Fn(u32) -> T) {
        for (out, row) in out.chunks_exact_mut(self.stride).zip(self.iter()) {
            for (out, value) in out.iter_mut().zip(row) {
                *out = convert(value);
            }
        }
    }
}
