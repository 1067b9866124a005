//! The shaders, put together from their files, and what they are told.
//!
//! # Floors
//! What a kernel must move and compute at least for each pixel and label of its level, or for each pixel where the table says
//! so, counted from its definition for the default method: values of 8 bits, factors of three members, a median's window of
//! 15 x 15 places, every second row of it. The least bytes are those that come from memory and go back where a cache
//! holds what neighbours share; asked is what the invocations ask for. An operation is one on a vector of four labels, unpacking
//! and packing included.
//!
//! | kernel | bytes, least | asked | operations / 4 labels, about | what it asks more than once |
//! |---|---|---|---|---|
//! | `census`, `contrast` | 24, 20 a pixel | 1,000 a pixel | 400 a pixel | the 63 places of the window |
//! | `ad_census` | 1 | 32 | 100 | the right row, once a label |
//! | `pyramid` (level 1, a fine label) | 1 + 2/8 | 31 | 100 | the 5 x 5 window |
//! | `evidence` | 1 + 1 + 1 | 4 | 25 | the costs, for their minimum |
//! | `dependency` | 1 + 3 + 3 | 15 | 50 | beliefs of three members, all of it again after the minimum |
//! | `belief` | 1 + 3 + 1 + 1 | 6 | 20 | nothing but the table of the graph |
//! | `resolution` (level 1, a fine label) | 1 + 1 + 1 + 3/8 | 17 | 100 | words of four labels, once a label and once more after the minimum |
//! | `winner_takes_all` | 1 | 2 | 15 | the beliefs, for the runner-up |
//! | `right_view` | 1 | 4 | 20 | words of four labels of which it wants one |
//! | `median` | 28 a pixel | 3,000 a pixel and pass | 2,500 a pixel and pass | the 105 places, in up to nine passes |
//!
//! Neighbouring invocations work on neighbouring pixels, and a row of a volume holds the first four labels of all its pixels,
//! then the next four: what a group of invocations asks for at once is side by side.
//!
//! What they ask more than once is near, and left to the caches. [`crate::roofline`] adds the least bytes of the message stages
//! up for a plan, and `mrfgs bench` holds them against the rate at which the device copies.

use crate::plan::{LABEL_BLOCK, LevelPlan, Plan, TruncationRule, VolumeWidth};
use bytemuck::{Pod, Zeroable};

const PARAMS: &str = include_str!("../../../shaders/shared/params.wgsl");
const NARROW: &str = include_str!("../../../shaders/shared/narrow.wgsl");
const WIDE: &str = include_str!("../../../shaders/shared/wide.wgsl");
const IMAGE: &str = include_str!("../../../shaders/shared/image.wgsl");
const MAPS: &str = include_str!("../../../shaders/shared/maps.wgsl");
const REGION: &str = include_str!("../../../shaders/shared/speckle.wgsl");

/// Pixels of a segment of a row, `SEGMENT` of `shaders/shared/speckle.wgsl`.
pub(super) const SEGMENT: u32 = 64;
/// Columns in which blocks of rows are joined in one go: it bounds the chains that the shader follows.
pub(super) const JOINED_COLUMNS: u32 = 4096;

/// A stage's shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "named after the shader files")]
pub enum Kernel {
    Census,
    Contrast,
    AdCensus,
    Sad,
    Pyramid,
    LabelRange,
    Evidence,
    Dependency,
    Resolution,
    Belief,
    WinnerTakesAll,
    SubPixel,
    RightView,
    Change,
    ChangeSum,
    SpeckleRuns,
    SpeckleJoin,
    SpeckleFlatten,
    SpeckleCount,
    SpeckleFilter,
    LeftRightCheck,
    Confidence,
    FillRows,
    FillSources,
    Fill,
    Median,
}

impl Kernel {
    /// Every shader there is.
    pub const ALL: [Self; 26] = [
        Self::Census,
        Self::Contrast,
        Self::AdCensus,
        Self::Sad,
        Self::Pyramid,
        Self::LabelRange,
        Self::Evidence,
        Self::Dependency,
        Self::Resolution,
        Self::Belief,
        Self::WinnerTakesAll,
        Self::SubPixel,
        Self::RightView,
        Self::Change,
        Self::ChangeSum,
        Self::SpeckleRuns,
        Self::SpeckleJoin,
        Self::SpeckleFlatten,
        Self::SpeckleCount,
        Self::SpeckleFilter,
        Self::LeftRightCheck,
        Self::Confidence,
        Self::FillRows,
        Self::FillSources,
        Self::Fill,
        Self::Median,
    ];

    /// Name of its file in `shaders/`, without the extension.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Census => "census",
            Self::Contrast => "contrast",
            Self::AdCensus => "ad_census",
            Self::Sad => "sad",
            Self::Pyramid => "pyramid",
            Self::LabelRange => "label_range",
            Self::Evidence => "evidence",
            Self::Dependency => "dependency",
            Self::Resolution => "resolution",
            Self::Belief => "belief",
            Self::WinnerTakesAll => "winner_takes_all",
            Self::SubPixel => "sub_pixel",
            Self::RightView => "right_view",
            Self::Change => "change",
            Self::ChangeSum => "change_sum",
            Self::SpeckleRuns => "speckle_runs",
            Self::SpeckleJoin => "speckle_join",
            Self::SpeckleFlatten => "speckle_flatten",
            Self::SpeckleCount => "speckle_count",
            Self::SpeckleFilter => "speckle_filter",
            Self::LeftRightCheck => "left_right_check",
            Self::Confidence => "confidence",
            Self::FillRows => "fill_rows",
            Self::FillSources => "fill_sources",
            Self::Fill => "fill",
            Self::Median => "median",
        }
    }

    fn body(self) -> &'static str {
        match self {
            Self::Census => include_str!("../../../shaders/census.wgsl"),
            Self::Contrast => include_str!("../../../shaders/contrast.wgsl"),
            Self::AdCensus => include_str!("../../../shaders/ad_census.wgsl"),
            Self::Sad => include_str!("../../../shaders/sad.wgsl"),
            Self::Pyramid => include_str!("../../../shaders/pyramid.wgsl"),
            Self::LabelRange => include_str!("../../../shaders/label_range.wgsl"),
            Self::Evidence => include_str!("../../../shaders/evidence.wgsl"),
            Self::Dependency => include_str!("../../../shaders/dependency.wgsl"),
            Self::Resolution => include_str!("../../../shaders/resolution.wgsl"),
            Self::Belief => include_str!("../../../shaders/belief.wgsl"),
            Self::WinnerTakesAll => include_str!("../../../shaders/winner_takes_all.wgsl"),
            Self::SubPixel => include_str!("../../../shaders/sub_pixel.wgsl"),
            Self::RightView => include_str!("../../../shaders/right_view.wgsl"),
            Self::Change => include_str!("../../../shaders/change.wgsl"),
            Self::ChangeSum => include_str!("../../../shaders/change_sum.wgsl"),
            Self::SpeckleRuns => include_str!("../../../shaders/speckle_runs.wgsl"),
            Self::SpeckleJoin => include_str!("../../../shaders/speckle_join.wgsl"),
            Self::SpeckleFlatten => include_str!("../../../shaders/speckle_flatten.wgsl"),
            Self::SpeckleCount => include_str!("../../../shaders/speckle_count.wgsl"),
            Self::SpeckleFilter => include_str!("../../../shaders/speckle_filter.wgsl"),
            Self::LeftRightCheck => include_str!("../../../shaders/left_right_check.wgsl"),
            Self::Confidence => include_str!("../../../shaders/confidence.wgsl"),
            Self::FillRows => include_str!("../../../shaders/fill_rows.wgsl"),
            Self::FillSources => include_str!("../../../shaders/fill_sources.wgsl"),
            Self::Fill => include_str!("../../../shaders/fill.wgsl"),
            Self::Median => include_str!("../../../shaders/median.wgsl"),
        }
    }

    /// The shader for a variant, as the device gets it.
    #[must_use]
    pub fn source(self, variant: Variant) -> String {
        let Variant { narrow, fine_narrow, slots, absolute, interpolating, low_pass, has_down, has_up } =
            variant;
        let width = if narrow { NARROW } else { WIDE };
        format!(
            "const FINE_NARROW = {fine_narrow};\nconst SLOTS = {slots}u;\nconst ABSOLUTE = {absolute};\n\
             const INTERPOLATING = {interpolating};\nconst LOW_PASS = {low_pass};\nconst HAS_DOWN = {has_down};\n\
             const HAS_UP = {has_up};\n{PARAMS}\n{width}\n{IMAGE}\n{MAPS}\n{REGION}\n{}",
            self.body()
        )
    }

    /// How often all loops of one invocation run at most, together. Mesa 22 stops a shader silently after about
    /// 65,000.
    #[must_use]
    pub fn loop_iterations(self, plan: &Plan, level: usize) -> usize {
        let l = &plan.levels[level];
        let (quads, slots) = (l.stride / 4, plan.slots());
        let fine_labels = plan.levels[level.saturating_sub(1)].stride;
        match self {
            Self::Census | Self::Contrast => 7 * 10,
            Self::AdCensus => 4,
            Self::Sad => {
                let window = plan.method.cost.sad_window as usize;
                (window + 7) * (1 + 5 * window + 8) + 8 * 5
            }
            Self::Pyramid => 7 * 31,
            Self::Evidence | Self::WinnerTakesAll => 2 * quads,
            Self::Dependency => {
                let floors =
                    if plan.dependency.rule == TruncationRule::Absolute { slots * (quads + 1) } else { 0 };
                floors + 3 * slots + 2 * quads * (2 * slots + 1)
            }
            Self::Resolution => fine_labels + 3 * l.stride + fine_labels / 2,
            // A pixel is a member of at most the 49 factors of its window.
            Self::Belief => 2 * 4 + 49 * 5,
            Self::SubPixel => 3 + 9 * 4,
            Self::RightView => l.labels,
            Self::Change => quads,
            Self::ChangeSum | Self::FillRows | Self::Fill => l.width,
            Self::FillSources => l.height,
            Self::SpeckleRuns => SEGMENT as usize,
            // The pixels on both sides of a border, or the segments of a row, followed from two pixels.
            Self::SpeckleJoin => 4 * (JOINED_COLUMNS as usize).max(l.width / SEGMENT as usize) + 8,
            Self::SpeckleFlatten => 2 * (JOINED_COLUMNS as usize).max(l.width / SEGMENT as usize) + 4,
            Self::LabelRange
            | Self::SpeckleCount
            | Self::SpeckleFilter
            | Self::LeftRightCheck
            | Self::Confidence => 0,
            Self::Median => {
                // One pass, and one for every three bits of what the disparities of a window may span.
                let window = plan.method.refinement.median_window as usize;
                (1 + 8) * (window + 1) * window + 8
            }
        }
    }
}

/// What a shader is specialised by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(clippy::struct_excessive_bools, reason = "each is a constant of the shaders")]
pub struct Variant {
    /// Messages and beliefs are stored in 8 bits instead of 16.
    pub narrow: bool,
    /// Costs read are stored in 8 bits instead of 16.
    pub fine_narrow: bool,
    /// Members of a dependency factor.
    pub slots: usize,
    /// The cut is [`TruncationRule::Absolute`].
    pub absolute: bool,
    /// Odd labels agree with both their coarse neighbours.
    pub interpolating: bool,
    /// The pyramid's low-pass in d instead of the minimum.
    pub low_pass: bool,
    /// There is a coarser level.
    pub has_down: bool,
    /// There is a finer level.
    pub has_up: bool,
}

impl Variant {
    /// What `kernel` is for `plan` at `level`, without what it does not look at, so that equal shaders compile once.
    #[must_use]
    pub fn new(kernel: Kernel, plan: &Plan, level: usize) -> Self {
        let looks = |kernels: &[Kernel]| kernels.contains(&kernel);
        let volumes = looks(&[
            Kernel::Evidence,
            Kernel::Dependency,
            Kernel::Resolution,
            Kernel::Belief,
            Kernel::WinnerTakesAll,
            Kernel::RightView,
            Kernel::Change,
        ]);
        let potentials = looks(&[Kernel::Dependency, Kernel::Resolution]);
        Self {
            narrow: volumes && plan.volume_width == VolumeWidth::Narrow,
            fine_narrow: match kernel {
                Kernel::LabelRange | Kernel::Evidence => level == 0,
                Kernel::Pyramid => level == 1,
                _ => false,
            },
            slots: if looks(&[Kernel::Dependency, Kernel::Belief]) { plan.slots() } else { 1 },
            absolute: potentials && plan.dependency.rule == TruncationRule::Absolute,
            interpolating: kernel == Kernel::Resolution && plan.interpolating(),
            low_pass: kernel == Kernel::Pyramid && !plan.minimum_over_d(),
            has_down: kernel == Kernel::Belief && level + 1 < plan.levels.len(),
            has_up: kernel == Kernel::Belief && level > 0,
        }
    }
}

/// Rows of every buffer start at a multiple of this many 32-bit words: the alignment of bindings everywhere.
pub(super) const ALIGN_WORDS: usize = 64;

/// `Level` of `shaders/shared/params.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[allow(missing_docs, reason = "explained in the shader")]
pub struct LevelParams {
    pub width: u32,
    pub height: u32,
    pub low: i32,
    pub labels: u32,
    pub quads: u32,
    pub pitch: u32,
    pub dependency_pitch: u32,
    pub member_pitch: u32,
    pub pixel_pitch: u32,
    pub starts_pitch: u32,
}

impl LevelParams {
    /// Parameters of `level`.
    #[must_use]
    pub fn new(plan: &Plan, level: &LevelPlan) -> Self {
        const { assert!(LABEL_BLOCK.is_multiple_of(16)) };
        let quads = level.stride / 4;
        let pitch = |words: usize| words.next_multiple_of(ALIGN_WORDS) as u32;
        Self {
            width: level.width as u32,
            height: level.height as u32,
            low: level.min,
            labels: level.labels as u32,
            quads: quads as u32,
            pitch: pitch(level.width * quads),
            dependency_pitch: pitch(level.width * plan.slots() * quads),
            member_pitch: pitch(level.width * plan.neighbours.div_ceil(4)),
            pixel_pitch: pitch(level.width),
            starts_pitch: pitch(level.width + 1),
        }
    }
}

/// `Params` of `shaders/shared/params.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[allow(missing_docs, reason = "explained in the shader")]
pub struct Params {
    pub level: LevelParams,
    pub padding_0: [u32; 2],
    pub fine: LevelParams,
    pub padding_1: [u32; 2],
    pub first_row: u32,
    pub rows: u32,
    pub row_groups: u32,
    pub grid: u32,
    pub outside_cost: u32,
    pub colour_weight: u32,
    pub colour_variance: u32,
    pub sad_radius: i32,
    pub label_offset: i32,
    pub evidence_multiplier: u32,
    pub evidence_limit: u32,
    pub evidence_up: u32,
    pub evidence_down: u32,
    pub evidence_cap: u32,
    pub tau: u32,
    pub sub_pixel: u32,
    pub left_right_check: u32,
    pub median_all: u32,
    pub speckle_size: u32,
    pub confidence_floor: u32,
    pub halo: u32,
    pub span: u32,
    pub first_column: u32,
    pub columns: u32,
    pub source_first_row: u32,
    pub source_rows: u32,
    pub median_radius: u32,
    pub median_step_bits: u32,
    pub median_scale: u32,
    pub median_doublings: u32,
    pub median_row_bits: u32,
    pub belief_most: u32,
}
