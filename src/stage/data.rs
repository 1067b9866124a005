//! What a backend holds of a match: volumes and maps.

use crate::plan::Plan;

/// Stands for "no label", in the right view where no left pixel projects.
pub const NO_LABEL: u16 = u16::MAX;

/// The belief that stands for "no runner-up".
pub const NO_RUNNER_UP: u16 = u16::MAX;

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
    /// Whether it is there where there are so many levels: the finest has no messages from below, the coarsest none from above.
    #[must_use]
    pub fn is_there(self, levels: usize) -> bool {
        match self {
            Self::Down(z) => z + 1 < levels,
            Self::Up(z) => z > 0,
            other => other.level() < levels,
        }
    }

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

/// A map of a match on its way, one value a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Map {
    /// Index of the label with the smallest belief, the lowest on ties.
    Label,
    /// Its belief, in units.
    Best,
    /// The smallest belief of the labels more than one away, [`NO_RUNNER_UP`] if there is none.
    RunnerUp,
    /// Label index of each pixel of the right view; [`NO_LABEL`] where no left pixel projects.
    RightLabel,
    /// Its belief, in units; [`u16::MAX`] where no left pixel projects.
    RightBest,
    /// Disparity before post-processing, in 1/256 px.
    Raw,
    /// Disparity as far as post-processing is done, in 1/256 px.
    Disparity,
    /// Bits of [`crate::maps::flag`].
    Validity,
    /// Confidence, 0 ..= 255.
    Confidence,
    /// [`Self::Raw`] at full size, where the pair is matched at half of that.
    FullRaw,
    /// [`Self::Disparity`] at full size.
    FullDisparity,
    /// [`Self::Validity`] at full size.
    FullValidity,
    /// [`Self::Confidence`] at full size.
    FullConfidence,
}

impl Map {
    /// Every map of the size of the finest level.
    pub const MATCHED: [Self; 9] = [
        Self::Label,
        Self::Best,
        Self::RunnerUp,
        Self::RightLabel,
        Self::RightBest,
        Self::Raw,
        Self::Disparity,
        Self::Validity,
        Self::Confidence,
    ];

    /// Every map of the full size.
    pub const FULL: [Self; 4] =
        [Self::FullRaw, Self::FullDisparity, Self::FullValidity, Self::FullConfidence];

    /// Every map that there is under `plan`.
    #[must_use]
    pub fn all(plan: &Plan) -> Vec<Self> {
        let full: &[Self] = if plan.full.is_some() { &Self::FULL } else { &[] };
        [&Self::MATCHED, full].concat()
    }

    /// (width, height) under `plan`, in pixels. At full size there are whole blocks of 2 x 2 pixels.
    #[must_use]
    pub fn size(self, plan: &Plan) -> (usize, usize) {
        let (width, height) = plan.size();
        if Self::FULL.contains(&self) { (2 * width, 2 * height) } else { (width, height) }
    }
}

/// What stages read and write.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Data {
    /// A volume.
    Volume(Volume),
    /// A map.
    Map(Map),
    /// The graph of a level: the members of its factors.
    Graph(usize),
    /// The sums of votes, by half-size pixel and every second label.
    Votes,
}

impl Data {
    /// The volume that it is, if it is one.
    #[must_use]
    pub fn volume(self) -> Option<Volume> {
        match self {
            Self::Volume(volume) => Some(volume),
            _ => None,
        }
    }
}

/// Number of values in `volume` under `plan`, and labels in a row of them, without and with padding.
#[must_use]
pub fn volume_shape(plan: &Plan, volume: Volume) -> (usize, usize, usize) {
    let rows = if matches!(volume, Volume::Dependency(_)) { plan.slots() } else { 1 };
    let level = &plan.levels[volume.level()];
    (level.pixels() * rows, level.labels, level.stride)
}

/// Values for a volume, as rows of labels to be stored with padding.
pub(crate) struct PaddedRows<'a> {
    values: &'a [u32],
    labels: usize,
    stride: usize,
    /// The padding is at least this, and a row's largest value.
    least: u32,
}

impl<'a> PaddedRows<'a> {
    pub(crate) fn new(plan: &Plan, volume: Volume, values: &'a [u32]) -> Self {
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
