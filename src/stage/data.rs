//! The data of a match: one table of volumes, maps, graphs and scratch memory.
//!
//! A row of [`Data::array`] defines how a device stores a datum: its name in shaders, its words per row, and
//! the image rows that its rows cover. Buffers, bindings, the memory of a plan, and tests of descriptors
//! follow from it.

use super::map::Map;
use super::volume::Volume;
use crate::plan::patches::{self, PATCH, PATCH_WORDS};
use crate::plan::votes::{self, Votes};
use crate::plan::{Plan, ROW_ALIGN};
use crate::weights::{MedianWeights, patch_weights, vote_weights};
use std::ops::Range;

/// Anything that stages read or write.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Data {
    /// A volume.
    Volume(Volume),
    /// A map.
    Map(Map),
    /// The image that members are chosen by, for each level; at level 0 the left view.
    Guide(usize),
    /// The guide of a level while it is computed.
    NextGuide(usize),
    /// Members of the dependency factors of a level.
    Members(usize),
    /// The factors that hold each pixel of a level: the transpose of the members.
    Incoming(usize),
    /// Label windows of a level: first label | number of labels with padding << 16.
    Windows(usize),
    /// Label windows of a level with all labels in each.
    FullWindows(usize),
    /// Lowest and highest candidate of each pixel of a level, for the windows of the next finer one.
    Candidates(usize),
    /// First and last label of each pixel of a level.
    LabelRange(usize),
    /// The prior of each pixel of a level: its interval, slope and cap.
    Prior(usize),
    /// The right view.
    Right,
    /// The left view as uploaded in whole 8-bit levels: one word per pixel.
    LeftWords,
    /// The right view as uploaded.
    RightWords,
    /// Census of the left view.
    LeftCensus,
    /// Census of the right view.
    RightCensus,
    /// Weight of colour in the matching cost.
    Contrast,
    /// The previous label map, for comparison.
    LabelMap,
    /// Squared differences of the last two label maps.
    Squares,
    /// Sums of [`Self::Squares`] by row: lower and upper half.
    RowSums,
    /// Whether the label map has settled.
    Convergence,
    /// Workgroup counts of indirect dispatches, zeroed once the label map has settled.
    Groups,
    /// Output of a map stage that reads a neighbourhood, before it replaces [`Map::Disparity`].
    NextDisparity,
    /// Like [`Self::NextDisparity`], for [`Map::Validity`] and [`Map::Confidence`].
    NextFlags,
    /// The maps as they are read back: [`Map::Disparity`] above the lowest one, confidence and validity in a word.
    PackedMaps,
    /// [`Map::Raw`] above the lowest disparity, two pixels in a word.
    PackedRaw,
    /// Like [`Self::PackedMaps`], at full size.
    FullPackedMaps,
    /// Like [`Self::PackedRaw`], at full size.
    FullPackedRaw,
    /// Union-find forest of the speckle filter.
    Parents,
    /// Sizes of the regions of the speckle filter.
    Sizes,
    /// Whether each row holds a valid pixel.
    KnownRows,
    /// The row from which each row is filled.
    SourceRows,
    /// The labels that the right view sees at each pixel, for votes.
    Shown,
    /// Colours of half-size pixels.
    HalfColours,
    /// The label that each half-size pixel votes for.
    Elected,
    /// Votes of a band of half-size rows and the rows around it, summed along rows.
    Sums,
    /// Votes of a band, summed along columns too.
    Totals,
    /// Weights of votes by colour.
    VoteWeights,
    /// Moments and colours of patches.
    Patches,
    /// Weights of patches by colour.
    PatchShares,
    /// Spatial weights of the median.
    MedianWeights,
    /// Spatial weights of the median of filled pixels.
    FillWeights,
    /// The left view at full size, as uploaded in whole 8-bit levels: one word per pixel.
    FullLeftWords,
    /// The right view at full size, as uploaded.
    FullRightWords,
    /// The left view at full size, if the pair is matched at half its size.
    FullLeft,
    /// The right view at full size.
    FullRight,
    /// Census of the left view at full size.
    FullLeftCensus,
    /// Census of the right view at full size.
    FullRightCensus,
    /// Costs of the four full-size pixels of each pixel, for disparities around its label.
    BlockCosts,
}

/// The image rows that the rows of an array cover.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// Rows of pixels of a level.
    Level(usize),
    /// Rows of pixels at full size, if the pair is matched at half its size.
    Full,
    /// Rows of half-size pixels of level 0.
    Half,
    /// Rows of patches.
    Patches,
    /// A table in one piece, without image rows.
    Table,
}

impl Extent {
    /// Number of rows.
    #[must_use]
    pub fn rows(self, plan: &Plan) -> usize {
        let height = plan.levels[0].height;
        match self {
            Self::Level(z) => plan.levels[z].height,
            Self::Full => 2 * height,
            Self::Half => height.div_ceil(2),
            Self::Patches => height.div_ceil(PATCH),
            Self::Table => 1,
        }
    }

    /// Number of full-size rows (twice the size of level 0) per row.
    fn step(self) -> usize {
        match self {
            Self::Full | Self::Table => 1,
            Self::Level(z) => 2 << z,
            Self::Half => 4,
            Self::Patches => 2 * PATCH,
        }
    }

    /// The rows that cover `rows` of `other`, with up to `around` more on either side.
    #[must_use]
    pub fn rows_of(self, plan: &Plan, rows: &Range<u32>, other: Self, around: u32) -> Range<u32> {
        let (height, own, theirs) = (self.rows(plan) as u32, self.step() as u32, other.step() as u32);
        if self == Self::Table {
            return 0..height;
        }
        let (start, end) = (rows.start * theirs / own, (rows.end * theirs).div_ceil(own));
        start.saturating_sub(around)..(end + around).min(height)
    }
}

/// The memory that an array occupies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// In memory of its own.
    Own,
    /// In the memory of an array that is never needed at the same time.
    In(Data),
    /// In any large enough volume that post-processing does not read.
    AnyVolume,
}

/// The contents of an array when a match starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// Unspecified: stages write it before they read it.
    Anything,
    /// Zeros.
    Zero,
    /// Part of the input: the pair, or data from the front end.
    Given,
    /// Constants that are equal in all matches by a plan.
    Constant,
}

/// How a device stores a datum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Array {
    /// The name in shaders, to which they may add a prefix or suffix (see [`Data::bound`]).
    pub name: &'static str,
    /// 32-bit words in a row, padding included.
    pub words: usize,
    /// The image rows that its rows cover.
    pub extent: Extent,
    /// Number of rows held. If stages work on bands, this is the size of the largest band.
    pub rows: usize,
    /// Whether only a band is held.
    pub of_band: bool,
    /// Contents when a match starts.
    pub start: Start,
    /// The memory that it occupies.
    pub place: Place,
}

impl Array {
    const fn new(name: &'static str, words: usize, extent: Extent, rows: usize) -> Self {
        Self { name, words, extent, rows, of_band: false, start: Start::Anything, place: Place::Own }
    }

    /// A table of `words` words.
    const fn table(name: &'static str, words: usize) -> Self {
        Self::new(name, words, Extent::Table, 1)
    }

    const fn starting(self, start: Start) -> Self {
        Self { start, ..self }
    }

    const fn of_band(self, rows: usize) -> Self {
        Self { rows, of_band: true, ..self }
    }

    const fn place(self, place: Place) -> Self {
        Self { place, ..self }
    }

    /// Bytes of all rows held.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        4 * self.words as u64 * self.rows as u64
    }
}

/// Words of a row, padded to a multiple of [`ROW_ALIGN`] bytes.
fn padded(words: usize) -> usize {
    words.next_multiple_of(ROW_ALIGN / 4)
}

impl Data {
    /// The left view.
    pub const LEFT: Self = Self::Guide(0);

    /// How a device stores this datum.
    #[must_use]
    #[rustfmt::skip]
    pub fn array(self, plan: &Plan) -> Array {
        use Start::{Anything, Constant, Given, Zero};
        let settles = plan.settled_change().is_some();
        let votes = || Votes::of(plan);
        let width = plan.levels[0].width;
        let rows = |name, words, extent: Extent| Array::new(name, words, extent, extent.rows(plan));
        // `words` per pixel of a level, of level 0, or of the full size.
        let level = |name, z: usize, words: usize| rows(name, words * padded(plan.levels[z].width), Extent::Level(z));
        let fine = |name, words: usize| level(name, 0, words);
        let full = |name, words: usize| rows(name, words * padded(2 * width), Extent::Full);
        // `slots` sets of labels per pixel.
        let slots = |name, volume: Volume, slots: usize| {
            let z = volume.level();
            let l = &plan.levels[z];
            rows(name, volume.bytes(plan) * padded(slots * l.width * l.quads()), Extent::Level(z))
        };
        let windows = |name, z: usize| {
            let (runs, rows) = plan.levels[z].windows();
            Array::table(name, padded(runs * rows))
        };
        let height = plan.levels[0].height;
        // The length is left out, since the words take time to compute.
        let constant = |name| Array::table(name, 0).starting(Constant);
        let votes_of = |name, labels: usize| {
            rows(name, padded(votes().width * labels), Extent::Half).place(Place::AnyVolume)
        };
        match self {
            // datum                           name                words per pixel, and the rows covered
            Self::Volume(volume @ Volume::Cost(_)) => slots("cost", volume, 1),
            Self::Volume(volume @ Volume::Evidence(_)) => slots("evidence", volume, 1),
            Self::Volume(volume @ Volume::Dependency(_)) => slots("dependency", volume, plan.slots()),
            Self::Volume(volume @ Volume::Down(_)) => slots("down", volume, 1),
            Self::Volume(volume @ Volume::Up(_)) => slots("up", volume, 1),
            Self::Volume(volume @ Volume::Belief(_)) => slots("belief", volume, 1),
            Self::Guide(0) => level("left", 0, 4).starting(Given),
            Self::Guide(z) => level("guide", z, 4),
            Self::NextGuide(z) => level("next_guide", z, 4),
            Self::Members(z) => {
                rows("members", padded(plan.levels[z].width * plan.neighbours.div_ceil(4)), Extent::Level(z))
            }
            Self::Incoming(z) => level("incoming", z, 2),
            Self::Windows(z) => windows("windows", z),
            Self::FullWindows(z) => windows("full_windows", z).starting(Constant),
            Self::Candidates(z) => level("candidates", z, 1),
            Self::LabelRange(z) => level("label_range", z, 1).starting(Given),
            Self::Prior(z) => level("prior", z, 2).starting(if plan.prior { Given } else { Anything }),
            Self::Right => fine("right", 4).starting(Given),
            Self::LeftWords => fine("left_words", 1).starting(Given).place(Place::In(Self::NextDisparity)),
            Self::RightWords => fine("right_words", 1).starting(Given).place(Place::In(Self::NextFlags)),
            Self::LeftCensus => fine("left_census", 2),
            Self::RightCensus => fine("right_census", 2),
            Self::Contrast => fine("contrast", 1),
            Self::LabelMap => fine("label_map", 1).starting(if settles { Zero } else { Anything }),
            Self::Squares => fine("squares", 1),
            Self::RowSums => Array::table("row_sums", 2 * height),
            Self::Convergence => Array::table("convergence", 6).starting(Zero),
            Self::Groups => Array::table("groups", 0),
            Self::Map(Map::Label | Map::Best | Map::RunnerUp) => fine("optima", Map::Label.words()),
            Self::Map(Map::RightLabel | Map::RightBest) => fine("right_labels", 1),
            Self::Map(Map::Raw) => fine("raw", 1),
            Self::Map(Map::Disparity) => fine("disparity", 1),
            Self::Map(Map::Anchor) => fine("anchors", 1).starting(Given),
            Self::Map(Map::Validity | Map::Confidence) => fine("flags", 1),
            Self::NextDisparity => fine("next_disparity", 1),
            Self::NextFlags => fine("next_flags", 1),
            Self::PackedMaps => fine("packed_maps", 1).place(Place::In(Self::NextDisparity)),
            Self::PackedRaw => {
                rows("packed_raw", padded(width.div_ceil(2)), Extent::Level(0)).place(Place::In(Self::NextFlags))
            }
            Self::FullPackedMaps => full("full_packed_maps", 1).place(Place::In(Self::FullLeftCensus)),
            Self::FullPackedRaw => {
                rows("full_packed_raw", padded(width), Extent::Full).place(Place::In(Self::FullRightCensus))
            }
            Self::Parents => fine("parents", 1).of_band(height),
            Self::Sizes => fine("sizes", 1).of_band(height),
            Self::KnownRows => Array::table("known_rows", height),
            Self::SourceRows => Array::table("row_sources", height),
            Self::Shown => fine("shown", 1).place(Place::In(Self::NextFlags)),
            Self::HalfColours => votes_of("half_colours", 1),
            Self::Elected => votes_of("elected", 1),
            Self::Sums => votes_of("sums", votes().labels).of_band(votes().summed()),
            Self::Totals => votes_of("totals", votes().labels).of_band(votes().band),
            Self::VoteWeights => constant("vote_weights"),
            Self::Patches => {
                let words = padded(PATCH_WORDS * patches::patches(plan).0);
                rows("patches", words, Extent::Patches).place(Place::AnyVolume)
            }
            Self::PatchShares => constant("patch_shares"),
            Self::MedianWeights => constant("median_weights"),
            Self::FillWeights => constant("fill_weights"),
            Self::FullLeft => full("full_left", 2).starting(Given),
            Self::FullRight => full("full_right", 2).starting(Given),
            Self::FullLeftWords => {
                full("full_left_words", 1).starting(Given).place(Place::In(Self::FullLeftCensus))
            }
            Self::FullRightWords => {
                full("full_right_words", 1).starting(Given).place(Place::In(Self::FullRightCensus))
            }
            Self::FullLeftCensus => full("full_left_census", 1),
            Self::FullRightCensus => full("full_right_census", 1),
            Self::BlockCosts => fine("block_costs", 4),
            Self::Map(Map::FullRaw) => full("full_raw", 1),
            Self::Map(Map::FullDisparity) => full("full_disparity", 1),
            Self::Map(Map::FullValidity | Map::FullConfidence) => full("full_flags", 1),
        }
    }

    /// The words of an array that is the same for every match of the plan; empty for others.
    #[must_use]
    pub fn constant(self, plan: &Plan) -> Vec<u32> {
        match self {
            Self::FullWindows(z) => {
                let (runs, rows) = plan.levels[z].windows();
                let mut words = vec![(plan.levels[z].stride as u32) << 16; runs * rows];
                words.resize(padded(words.len()), 0);
                words
            }
            Self::VoteWeights => vote_weights().concat(),
            Self::PatchShares => patch_weights(),
            Self::MedianWeights => MedianWeights::of(&plan.method).words(),
            // Spatial weights do not depend on the step.
            Self::FillWeights => MedianWeights::of_filled(&plan.method, [0; 2]).words(),
            _ => Vec::new(),
        }
    }

    /// The level of data that exist per level.
    #[must_use]
    pub fn level(self) -> Option<usize> {
        match self {
            Self::Volume(volume) => Some(volume.level()),
            Self::Guide(z)
            | Self::NextGuide(z)
            | Self::Members(z)
            | Self::Incoming(z)
            | Self::Windows(z)
            | Self::FullWindows(z)
            | Self::Candidates(z)
            | Self::LabelRange(z)
            | Self::Prior(z) => Some(z),
            _ => None,
        }
    }

    /// Data of a level that coarser levels may keep in one shared buffer, so that one dispatch can process them all.
    #[must_use]
    pub fn of_levels(z: usize) -> [Self; 9] {
        [
            Self::Volume(Volume::Evidence(z)),
            Self::Volume(Volume::Dependency(z)),
            Self::Volume(Volume::Down(z)),
            Self::Volume(Volume::Up(z)),
            Self::Volume(Volume::Belief(z)),
            Self::Windows(z),
            Self::Guide(z),
            Self::Members(z),
            Self::Incoming(z),
        ]
    }

    /// All other data of a level.
    #[must_use]
    pub fn of_level(z: usize) -> [Self; 6] {
        [
            Self::Volume(Volume::Cost(z)),
            Self::FullWindows(z),
            Self::Candidates(z),
            Self::LabelRange(z),
            Self::Prior(z),
            Self::NextGuide(z),
        ]
    }

    /// All data that belong to no level.
    #[must_use]
    pub fn of_match() -> Vec<Self> {
        let maps = Map::MATCHED.into_iter().chain([Map::Anchor]).chain(Map::FULL).map(Self::Map);
        let others = [
            Self::Right,
            Self::LeftCensus,
            Self::RightCensus,
            Self::Contrast,
            Self::LabelMap,
            Self::Squares,
            Self::RowSums,
            Self::Convergence,
            Self::Groups,
            Self::NextDisparity,
            Self::NextFlags,
            Self::LeftWords,
            Self::RightWords,
            Self::PackedMaps,
            Self::PackedRaw,
            Self::Shown,
            Self::Parents,
            Self::Sizes,
            Self::KnownRows,
            Self::SourceRows,
            Self::HalfColours,
            Self::Elected,
            Self::Sums,
            Self::Totals,
            Self::VoteWeights,
            Self::Patches,
            Self::PatchShares,
            Self::MedianWeights,
            Self::FillWeights,
            Self::FullLeft,
            Self::FullRight,
            Self::FullLeftCensus,
            Self::FullRightCensus,
            Self::FullLeftWords,
            Self::FullRightWords,
            Self::FullPackedMaps,
            Self::FullPackedRaw,
            Self::BlockCosts,
        ];
        maps.chain(others).collect()
    }

    /// The data that belong to no level, one for each array of `plan`.
    #[must_use]
    pub fn arrays_of_match(plan: &Plan) -> Vec<Self> {
        let shares = |data: &Self| {
            use Map::{Best, Confidence, FullConfidence, RightBest, RunnerUp};
            matches!(data, Self::Map(Best | RunnerUp | RightBest | Confidence | FullConfidence))
        };
        Self::of_match().into_iter().filter(|data| !shares(data) && data.is_there(plan)).collect()
    }

    /// All data of a match by `plan`.
    #[must_use]
    pub fn all(plan: &Plan) -> Vec<Self> {
        let levels =
            (0..plan.levels.len()).flat_map(|z| Self::of_levels(z).into_iter().chain(Self::of_level(z)));
        levels.chain(Self::of_match()).filter(|data| data.is_there(plan)).collect()
    }

    /// Whether a match by `plan` has this datum.
    #[must_use]
    pub fn is_there(self, plan: &Plan) -> bool {
        let levels = plan.levels.len();
        match self {
            Self::Volume(volume) => volume.is_there(levels),
            Self::NextGuide(z) | Self::Candidates(z) => (1..levels).contains(&z),
            Self::LabelRange(z) => z < levels && plan.limits_labels(),
            Self::Prior(z) => z < levels && plan.has_priors(),
            Self::Map(Map::Anchor) => plan.prior,
            Self::LeftWords | Self::RightWords => plan.full.is_none(),
            Self::PackedMaps | Self::PackedRaw => plan.packs_maps() && plan.full.is_none(),
            Self::FullPackedMaps | Self::FullPackedRaw => plan.packs_maps() && plan.full.is_some(),
            Self::FullLeft
            | Self::FullRight
            | Self::FullLeftWords
            | Self::FullRightWords
            | Self::FullLeftCensus
            | Self::FullRightCensus
            | Self::BlockCosts
            | Self::Map(Map::FullRaw | Map::FullDisparity | Map::FullValidity | Map::FullConfidence) => {
                plan.full.is_some()
            }
            Self::HalfColours | Self::Elected | Self::Sums | Self::Totals | Self::VoteWeights => {
                votes::are_taken(&plan.method)
            }
            Self::Patches | Self::PatchShares => patches::are_taken(&plan.method),
            other => other.level().is_none_or(|z| z < levels),
        }
    }

    /// The table name and the level of the array that a kernel at `level` binds as `name`: the prefix `fine_`
    /// means the next finer level, `source_` other rows, and the suffixes `_in` and `_out` the arrays that a
    /// shader reads and writes in turn.
    #[must_use]
    pub fn place_of(name: &str, level: usize) -> (&str, usize) {
        let name = name.strip_suffix("_in").or(name.strip_suffix("_out")).unwrap_or(name);
        let name = name.strip_prefix("source_").unwrap_or(name);
        let (name, level) = match name.strip_prefix("fine_") {
            Some(name) => (name, level.saturating_sub(1)),
            None => (name, level),
        };
        // The left view is the guide of level 0.
        if (name, level) == ("guide", 0) { ("left", 0) } else { (name, level) }
    }

    /// The data in the array that a kernel at `level` binds as `name`; several if maps share it.
    #[must_use]
    pub fn bound(plan: &Plan, name: &str, level: usize) -> Vec<Self> {
        let (name, level) = Self::place_of(name, level);
        let is_meant = |data: &Self| data.level().is_none_or(|z| z == level) && data.array(plan).name == name;
        Self::all(plan).into_iter().filter(is_meant).collect()
    }

    /// The volume, if this is one.
    #[must_use]
    pub fn volume(self) -> Option<Volume> {
        match self {
            Self::Volume(volume) => Some(volume),
            _ => None,
        }
    }
}
