//! The seam: what every backend can do, stage by stage.
//!
//! A backend knows stages, not their order; [`crate::solver`] alone knows that. Everything from the matching cost
//! on is integer arithmetic, so all backends give the same bits. The documentation of each [`Stage`] is the
//! definition that the CPU stage, the shader and the naive twin in the tests follow independently.

pub mod cpu;
pub mod gpu;

use crate::error::Result;
use crate::graph::LevelGraph;
use crate::image::{Pair, Plane};
use crate::maps::Maps;
use crate::plan::Plan;
use std::time::Duration;

/// Stands for "no label", in the right view where no left pixel projects.
pub const NO_LABEL: u16 = u16::MAX;

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

/// A map that tests and diagnostics may read and write, one value a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Map {
    /// Index of the label with the smallest belief, the lowest on ties.
    Label,
    /// Its belief, in units.
    Best,
    /// The smallest belief of the labels more than one away, [`u16::MAX`] if there is none.
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
}

impl Map {
    /// Every map there is.
    pub const ALL: [Self; 9] = [
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
}

/// A stage of the method, with its level where it has one. Each variant's documentation is the exact definition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Stage {
    /// Matching cost of level 0, 0 ..= [`crate::plan::COST_MAX`].
    ///
    /// The cost of pixel (x, y) and disparity d compares left (x, y) with right (x - d, y). It is
    /// [`Plan::outside_cost`] when x - d is outside the image or either pixel is masked. Otherwise:
    /// - SAD: round(S / (768 n)), at most [`crate::plan::COST_MAX`], ties up, where n counts the places (i, j) of the
    ///   window at which left (x + i, y + j) and right (x - d + i, y + j) are both inside and unmasked, and S sums
    ///   |dr| + |dg| + |db| over them.
    /// - Census: 4 min(h, 40), where h bits of the two censuses differ. The census of a pixel has a bit for each other
    ///   place of a 9 x 7 window, set where that place, clamped to the image, is unmasked and its grey is below the
    ///   centre's.
    /// - AD-census: that plus (w min(|dr| + |dg| + |db|, 64) + 32) >> 6, channels in whole 8-bit levels (>> 8), with the
    ///   weight w = floor(48 min(v, t) / t) of the left pixel, 48 where t = [`Plan::colour_variance`] is 0. Over the same
    ///   window, clamped places again,
    ///   v = 63 sum g^2 - (sum g)^2 with g the grey >> 8, that of the centre where the place is masked.
    Cost,
    /// Cost of a level (1 or coarser) from that of the next finer one, in 1/256 cost units (costs of level 0 count
    /// 256 times).
    ///
    /// First x and y: for each fine label the 5 x 5 binomial mean (1 4 6 4 1, outer product) around (2 x, 2 y),
    /// coordinates clamped to the image, rounded as (sum + 128) >> 8. Then d, from those means: for coarse label z, with
    /// low-pass their binomial mean over the fine labels 2 z - 2 ..= 2 z + 2, labels clamped to the fine range, rounded as
    /// (sum + 8) >> 4; with the minimum, the smallest at those labels of 2 z - 1 ..= 2 z + 1 that are in the range.
    Pyramid(usize),
    /// Costs of a level at labels outside the pixel's label range, as given to [`Backend::label_range`], become the highest there
    /// is: [`crate::plan::COST_MAX`] (256 times that at coarser levels).
    LabelRange(usize),
    /// Evidence of a level from its cost by its [`crate::plan::EvidenceScale`] (costs of level 0 count 256 times), and
    /// beliefs equal to the evidence.
    Evidence(usize),
    /// Messages of the dependency factors of a level, from the beliefs and their own old messages.
    ///
    /// With q of each member, its belief less the factor's old message to it (less its minimum over d where the rule is
    /// [`crate::plan::TruncationRule::Absolute`]), the message to a member is s = the sum of q over the other members, at most
    /// [`VolumeWidth::most`](crate::plan::VolumeWidth::most), cut by [`Plan::dependency`] with its bounds for the smallest s. A factor of
    /// one member, and a slot without one, keep the message they have: 0, from the start.
    Dependency(usize),
    /// Messages of the resolution factors between a level (1 or coarser) and the next finer one, in both directions,
    /// from the beliefs and their own old messages.
    ///
    /// Each coarse pixel (x, y) has one factor with its children (2 x, 2 y) to (2 x + 1, 2 y + 1), as far as they are
    /// inside. q is the belief less the factor's old message (less its minimum where the rule is absolute). Labels d
    /// and z agree when |d - 2 z| is at most 1 (interpolating) or 0 (strict). U\[c\](z) is the smallest q\[c\](d) of
    /// the d that agree with z, infinite if none does. To the parent: s(z) = the sum of U\[c\](z). To child c:
    /// t(z) = q\[p\](z) + the sum of the other children's U(z), and s(d) = the smallest t(z) of the z that agree with d,
    /// infinite if none does. Each s is cut by [`Plan::resolution`] with its bounds for the smallest s. Infinite is
    /// [`VolumeWidth::most`](crate::plan::VolumeWidth::most), and sums saturate there; where every s is infinite, the message is 0.
    Resolution(usize),
    /// Beliefs of a level: evidence, plus every dependency message to the pixel, plus the resolution messages from
    /// above and from below; at most [`Plan::belief_most`].
    Belief(usize),
    /// [`Stage::Dependency`] and then [`Stage::Belief`] of a level.
    Flood(usize),
    /// The label map of level 0, and the sum over its pixels of the squared difference from the map of the last
    /// time (of label indices; from 0 the first time), which [`Backend::change`] returns.
    Change,
    /// [`Map::Label`], [`Map::Best`] and [`Map::RunnerUp`] of level 0.
    WinnerTakesAll,
    /// [`Map::RightLabel`] and [`Map::RightBest`]: at (x, y) the label with the smallest belief of left pixel (x + d, y) among
    /// those in the columns [`Plan::core`], the lowest on ties, and that belief.
    RightView,
    /// [`Map::Raw`], and [`Map::Disparity`] equal to it: the label and, where [`crate::options::RefinementOptions::sub_pixel`] asks
    /// for it, its offset.
    ///
    /// The offset is the tip of the symmetric V, the steeper side setting the slope of both, through three sums of
    /// matching cost: a, b and c at the label below, at the label and above, each over those pixels of the 3 x 3
    /// neighbourhood, as far as it is inside, whose own label is at most one away. With s = max(a, c) - b it is
    /// floor((256 (a - c) + s) / (2 s)), clamped to -128 ..= 128, and 0 where s <= 0 or at an end of the range. (The cost and
    /// not the belief: the cut of the messages flattens the belief beside its optimum and draws a fit to whole labels.)
    SubPixel,
    /// [`Map::Validity`]: [`flag::MASKED`] alone on pixels masked in the left image. On the others, where
    /// [`crate::options::RefinementOptions::left_right_check`] is not off, [`flag::OUTSIDE`] where the match is outside the right image
    /// and [`flag::OCCLUDED`] where the right pixel's own label differs by more than one, and otherwise 0.
    ///
    /// [`flag::MASKED`]: crate::maps::flag::MASKED
    /// [`flag::OUTSIDE`]: crate::maps::flag::OUTSIDE
    /// [`flag::OCCLUDED`]: crate::maps::flag::OCCLUDED
    LeftRightCheck,
    /// Sets [`flag::SPECKLE`](crate::maps::flag::SPECKLE) on every pixel of each region of fewer than
    /// [`crate::options::RefinementOptions::speckle_size`] pixels. Regions are of the pixels that [`Stage::LeftRightCheck`] left without a
    /// flag, 4-connected; labels that differ by at most one connect.
    SpeckleFilter,
    /// [`Map::Confidence`]: how far the best runner-up is behind the optimum, in half units (eighths of a nat), at most 255;
    /// 255 where there is no runner-up, 0 for invalid pixels. Sets
    /// [`flag::LOW_CONFIDENCE`](crate::maps::flag::LOW_CONFIDENCE) on valid pixels below
    /// [`crate::options::RefinementOptions::confidence_floor`].
    Confidence,
    /// Fills [`Map::Disparity`] on every invalid pixel that is not masked with the smaller of the nearest valid
    /// disparities to the left and to the right on its row, or the one there is: what is occluded belongs to the
    /// farther surface. A row without any valid pixel takes the nearest row that has one, the upper on ties. Sets
    /// [`flag::FILLED`](crate::maps::flag::FILLED). Where no pixel at all is valid, nothing is filled.
    Fill,
    /// [`Stage::Median`] on filled pixels alone, over all rows of its window, and that stretched: its places are 4 pixels
    /// apart, distance counts in places, and the range parameter is a quarter.
    FillMedian,
    /// Weighted median of [`Map::Disparity`], on the pixels that [`crate::options::RefinementOptions::median`] names and that have a
    /// disparity, over the pixels that have one in the centre's row of the window and in every second row from there: the
    /// smallest value at which half of the weight is reached. Weights are [`crate::weights::MedianWeights`] of the left image.
    Median,
}

impl Stage {
    /// Its name, which is its shader's and its module's too.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Cost => "cost",
            Self::Pyramid(_) => "pyramid",
            Self::LabelRange(_) => "label_range",
            Self::Evidence(_) => "evidence",
            Self::Dependency(_) => "dependency",
            Self::Resolution(_) => "resolution",
            Self::Belief(_) => "belief",
            Self::Flood(_) => "flood",
            Self::Change => "change",
            Self::WinnerTakesAll => "winner_takes_all",
            Self::RightView => "right_view",
            Self::SubPixel => "sub_pixel",
            Self::LeftRightCheck => "left_right_check",
            Self::SpeckleFilter => "speckle_filter",
            Self::Confidence => "confidence",
            Self::Fill => "fill",
            Self::FillMedian => "fill_median",
            Self::Median => "median",
        }
    }

    /// The level it works on, where it is not the finest by nature.
    #[must_use]
    pub fn level(self) -> Option<usize> {
        match self {
            Self::Pyramid(z)
            | Self::LabelRange(z)
            | Self::Evidence(z)
            | Self::Dependency(z)
            | Self::Resolution(z)
            | Self::Belief(z)
            | Self::Flood(z) => Some(z),
            _ => None,
        }
    }
}

/// What a match asked of a device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Dispatches.
    pub dispatches: u64,
    /// Submissions to the queue.
    pub submissions: u64,
    /// Bytes written to the device.
    pub bytes_up: u64,
    /// Bytes read from it.
    pub bytes_down: u64,
    /// Bytes of the buffers that it holds for the match.
    pub bytes_held: u64,
}

/// Of one match after another: what went through adds up, and the most was held.
impl std::ops::AddAssign for Traffic {
    fn add_assign(&mut self, more: Self) {
        self.dispatches += more.dispatches;
        self.submissions += more.submissions;
        self.bytes_up += more.bytes_up;
        self.bytes_down += more.bytes_down;
        self.bytes_held = self.bytes_held.max(more.bytes_held);
    }
}

/// Maps on their way from what computes them.
pub enum Requested {
    /// They are here.
    Here(Maps),
    /// A device sends them.
    Device(gpu::RequestedMaps),
}

/// What runs the stages. Every method fails with [`crate::Error::Device`] when the device does.
#[allow(clippy::missing_errors_doc, reason = "said once, above")]
pub trait Backend {
    /// What runs the stages, for people: "CPU path, 2 threads", "llvmpipe (Vulkan)".
    fn describe(&self) -> String;

    /// The driver of the device and its version, as far as it says; `None` where there is no device.
    fn driver(&self) -> Option<String> {
        None
    }

    /// Takes the pair and the graphs of all levels of `plan`, and sets all messages, and the map that
    /// [`Stage::Change`] compares with, to 0. All that the stages need is allocated here, from the plan alone; a second
    /// pair whose plan [fits](Plan::fits) goes into the same buffers.
    ///
    /// # Errors
    /// [`crate::Error::Memory`] and [`crate::Error::Device`] when the buffers cannot be had.
    fn prepare(&mut self, plan: &Plan, pair: &Pair, graphs: Vec<LevelGraph>) -> Result<()>;

    /// Takes the label range of every pixel for [`Stage::LabelRange`], once the pair is prepared: at each level the first and the
    /// last label index that it may have. Only for plans whose method has a [`crate::options::FrontOptions::zone_sigmas`].
    fn label_range(&mut self, label_ranges: &[Plane<[u16; 2]>]) -> Result<()>;

    /// Runs a stage. Devices may still be at it when this returns.
    fn run(&mut self, stage: Stage) -> Result<()>;

    /// Runs [`Stage::Change`] and returns its sum.
    fn change(&mut self) -> Result<u64>;

    /// Waits until every stage has run.
    fn wait(&mut self) -> Result<()>;

    /// Asks for the maps as they are once all stages before have run. The next pair may be prepared before they arrive.
    fn request_maps(&mut self) -> Result<Requested>;

    /// The maps that this backend was asked for, once they have arrived.
    fn maps(&mut self, requested: Requested) -> Result<Maps>;

    /// Starts to take the time of every stage, or stops.
    fn keep_time(&mut self, on: bool) -> Result<()>;

    /// The time of every run of a stage since [`Backend::keep_time`] was last called, in order: a device's own where it has
    /// a clock.
    fn times(&mut self) -> Result<Vec<(Stage, Duration)>>;

    /// What went through since [`Backend::prepare`], which is included; all 0 where there is no device.
    fn traffic(&self) -> Traffic;

    /// The values of `volume`.
    fn read(&mut self, volume: Volume) -> Result<Vec<u32>>;

    /// Replaces the values of `volume`.
    fn write(&mut self, volume: Volume, values: &[u32]) -> Result<()>;

    /// The values of `map`.
    fn read_map(&mut self, map: Map) -> Result<Plane<i32>>;

    /// Replaces the values of `map`.
    fn write_map(&mut self, map: Map, values: &Plane<i32>) -> Result<()>;

    /// Overwrites every buffer with `byte`: whatever the next match of the same plan reads before it wrote it, shows.
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
struct PaddedRows<'a> {
    values: &'a [u32],
    labels: usize,
    stride: usize,
    /// The padding is at least this, and a row's largest value.
    least: u32,
}

impl<'a> PaddedRows<'a> {
    fn new(plan: &Plan, volume: Volume, values: &'a [u32]) -> Self {
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
    fn iter(&self) -> impl Iterator<Item = Vec<u32>> {
        self.values.chunks_exact(self.labels).map(|row| {
            let padding = row.iter().copied().max().unwrap_or(0).max(self.least);
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
