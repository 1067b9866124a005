//! The seam: what every backend can do, one method a stage.
//!
//! A backend knows stages, not their order; [`crate::solver`] alone knows that. Everything from the matching cost
//! on is integer arithmetic, so all backends give the same bits. The documentation of each method is the
//! definition that the CPU stage, the shader and the naive twin in the tests follow independently.

pub mod cpu;
pub mod gpu;

use crate::error::Result;
use crate::graph::LevelGraph;
use crate::image::{Pair, Plane};
use crate::plan::Plan;

/// Stands for "no label", in the right view where no left pixel projects.
pub const NO_LABEL: u16 = u16::MAX;

/// The belief of one pixel around its optimum, in units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Peak {
    /// Index of the label with the smallest belief, the lowest on ties.
    pub label: u16,
    /// Its belief.
    pub best: u16,
    /// The smallest belief of the labels more than one away, [`u16::MAX`] if there is none.
    pub rival: u16,
}

/// What leaves a backend after the last iteration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Estimate {
    /// The optimum of each pixel of the reference view.
    pub peaks: Plane<Peak>,
    /// How far the disparity of each pixel is above its label, in 1/256 px, -128 ..= 128.
    pub offsets: Plane<i16>,
    /// Label index of each pixel of the right view, read off the same beliefs; [`NO_LABEL`] where no left pixel
    /// projects.
    pub right: Plane<u16>,
}

/// A volume that tests and diagnostics may read and write, in the layout \[y\]\[x\]\[slot\]\[label\] (slot only
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

/// The stages of the method. Each fails with [`crate::Error::Device`] when its device does, and otherwise never.
#[allow(clippy::missing_errors_doc, reason = "said once, above")]
pub trait Backend {
    /// What runs the stages, for people: "CPU path, 2 threads", "llvmpipe (Vulkan)".
    fn describe(&self) -> String;

    /// Takes the pair and the graphs of all levels of `plan`, allocates all buffers, and sets all messages to 0.
    ///
    /// # Errors
    /// [`crate::Error::Memory`] and [`crate::Error::Device`] when the buffers cannot be had.
    fn prepare(&mut self, plan: &Plan, pair: &Pair, graphs: Vec<LevelGraph>) -> Result<()>;

    /// Matching cost of level 0, 0 ..= [`crate::plan::COST_MAX`].
    ///
    /// The cost of pixel (x, y) and disparity d compares left (x, y) with right (x - d, y). It is
    /// [`Plan::outside_cost`] when x - d is outside the image or either pixel is masked. Otherwise:
    /// - SAD: round(S / (768 n)), at most [`crate::plan::COST_MAX`], ties up, where n counts the places (i, j) of the
    ///   window at which left (x + i, y + j) and right (x - d + i, y + j) are both inside and unmasked, and S sums
    ///   |dr| + |dg| + |db| over them.
    /// - AD-census: [`crate::tables::ad_cost`] at (|dr| + |dg| + |db|) >> 8 plus [`crate::tables::census_cost`] at the
    ///   number of census bits that differ. The census of a pixel has a bit for each other place of a 9 x 7
    ///   window, set where that place, clamped to the image, is unmasked and its grey is below the centre's.
    fn cost(&mut self) -> Result<()>;

    /// Cost of `level` (1 or coarser) from that of the next finer one, in 1/256 cost units (costs of level 0 count
    /// 256 times).
    ///
    /// First x and y: for each fine label the 5 x 5 binomial mean (1 4 6 4 1, outer product) around (2 x, 2 y),
    /// coordinates clamped to the image, rounded as (sum + 128) >> 8. Then d, from those means: for coarse label z, with
    /// low-pass their binomial mean over the fine labels 2 z - 2 ..= 2 z + 2, labels clamped to the fine range, rounded as
    /// (sum + 8) >> 4; with the minimum, the smallest at those labels of 2 z - 1 ..= 2 z + 1 that are in the range.
    fn pyramid(&mut self, level: usize) -> Result<()>;

    /// Evidence of `level` from its cost by its [`crate::plan::EvidenceScale`] (costs of level 0 count 256 times), and
    /// beliefs equal to the evidence.
    fn evidence(&mut self, level: usize) -> Result<()>;

    /// Messages of the dependency factors of `level`, from the beliefs and their own old messages.
    ///
    /// With q of each member, its belief less the factor's old message to it (less its minimum over d where the rule is
    /// [`crate::plan::CutRule::Absolute`]), the message to a member is s = the sum of q over the other members, cut by
    /// [`Plan::dependency`] with its bounds for the smallest s. A factor of one member, and a slot without
    /// one, keep the message they have: 0, from the start.
    fn dependency(&mut self, level: usize) -> Result<()>;

    /// Messages of the resolution factors between `level` (1 or coarser) and the next finer one, in both directions,
    /// from the beliefs and their own old messages.
    ///
    /// Each coarse pixel (x, y) has one factor with its children (2 x, 2 y) to (2 x + 1, 2 y + 1), as far as they are
    /// inside. q is the belief less the factor's old message (less its minimum where the rule is absolute). Labels d
    /// and z agree when |d - 2 z| is at most 1 (interpolating) or 0 (strict). U\[c\](z) is the smallest q\[c\](d) of
    /// the d that agree with z, infinite if none does. To the parent: s(z) = the sum of U\[c\](z). To child c:
    /// t(z) = q\[p\](z) + the sum of the other children's U(z), and s(d) = the smallest t(z) of the z that agree with d,
    /// infinite if none does. Each s is cut by [`Plan::resolution`] with its bounds for the smallest s. Infinite is
    /// 2^20, and sums saturate there; where every s is infinite, the message is 0.
    fn resolution(&mut self, level: usize) -> Result<()>;

    /// Beliefs of `level`: evidence, plus every dependency message to the pixel, plus the resolution messages from
    /// above and from below.
    fn belief(&mut self, level: usize) -> Result<()>;

    /// The label map of level 0, and the sum over its pixels of the squared difference from the map of the last
    /// call (of label indices; from 0 on the first call).
    fn change(&mut self) -> Result<u64>;

    /// The optimum of every pixel, its offset between labels, and the map of the right view.
    ///
    /// The offset is the tip of the symmetric V, the steeper side setting the slope of both, through three sums of
    /// matching cost: a, b and c at the label below, at the label and above, each over those pixels of the 3 x 3
    /// neighbourhood, as far as it is inside, whose own label is at most one away. With s = max(a, c) - b it is
    /// floor((256 (a - c) + s) / (2 s)), clamped to -128 ..= 128, and 0 where s <= 0 or at an end of the range. (The cost and
    /// not the belief: the cut of the messages flattens the belief beside its optimum and draws a fit to whole labels.)
    ///
    /// The right view has at (x, y) the d with the smallest belief of left pixel (x + d, y) among those inside, the lowest
    /// on ties.
    fn estimate(&mut self) -> Result<Estimate>;

    /// The values of `volume`.
    fn read(&mut self, volume: Volume) -> Result<Vec<u32>>;

    /// Replaces the values of `volume`.
    fn write(&mut self, volume: Volume, values: &[u32]) -> Result<()>;
}

/// Number of values in `volume` under `plan`, and labels in a row of them, without and with padding.
#[must_use]
pub fn volume_shape(plan: &Plan, volume: Volume) -> (usize, usize, usize) {
    let rows = if matches!(volume, Volume::Dependency(_)) { plan.slots() } else { 1 };
    let level = &plan.levels[volume.level()];
    (level.pixels() * rows, level.labels, level.stride)
}

/// Values for a volume, as rows of labels to be stored with padding.
struct PaddedRows<'a> {
    values: &'a [u32],
    labels: usize,
    stride: usize,
    /// How far the padding is above a row's largest value.
    margin: u32,
}

impl<'a> PaddedRows<'a> {
    fn new(plan: &Plan, volume: Volume, values: &'a [u32]) -> Self {
        let (rows, labels, stride) = volume_shape(plan, volume);
        assert_eq!(values.len(), rows * labels, "values of {volume:?}");
        // Padding must never look better than a label, also after a message is taken off a belief.
        let margin = match volume {
            Volume::Belief(_) => plan.dependency.tau.max(plan.resolution.tau).into(),
            _ => 0,
        };
        Self { values, labels, stride, margin }
    }

    /// Rows of `stride` values each.
    fn iter(&self) -> impl Iterator<Item = Vec<u32>> {
        self.values.chunks_exact(self.labels).map(|row| {
            let padding = row.iter().copied().max().unwrap_or(0) + self.margin;
            let mut row = row.to_vec();
            row.resize(self.stride, padding);
            row
        })
    }

    fn fill<T>(&self, out: &mut [T], convert: impl Fn(u32) -> T) {
        for (out, row) in out.chunks_exact_mut(self.stride).zip(self.iter()) {
            for (out, value) in out.iter_mut().zip(row) {
                *out = convert(value);
            }
        }
    }
}
