//! Everything about a match that is known before it runs: levels, integer parameters, bounds, memory.
//!
//! A plan is pure: it depends on the image size, the disparity range and the [`Method`] alone. It is
//! therefore the same on every machine, can be tested without a device, and is what `--dry-run` prints.
//!
//! # Units
//! Messages, evidence and beliefs are costs, the -log of the paper's probabilities, in [`UNITS_PER_NAT`]
//! units per nat. All are non-negative integers, and the minimum of every message over the labels is 0. They
//! and their sums are stored in 8 bits, or in 16 where the method needs them ([`VolumeWidth`]). Sums
//! saturate; a label whose cost saturates is no longer a candidate, so its exact cost does not matter.

use crate::error::Result;
use crate::options::{
    Agreement, DisparityRange, Illumination, LeftRightCheck, MatchingCost, Method, Order, Potential, Pyramid,
};
use std::ops::Range;

/// Units of cost in one nat.
pub const UNITS_PER_NAT: f64 = 4.0;
/// Truncation of a hard potential's messages, in units. It is the largest for which no belief saturates in 16
/// bits, even for a pixel that is a member of all 49 factors of its window, with two resolution messages and
/// the largest evidence.
pub const HARD_CAP: u16 = 1023;
/// Largest matching cost at level 0, in cost units.
pub const COST_MAX: u8 = 254;
/// Cost units that stand for a matching cost of 1 where the cost uses the census.
pub const CENSUS_UNITS: f64 = 128.0;
/// Cost units of each census bit that differs.
pub const CENSUS_BIT_COST: u32 = 4;
/// Largest number of differing census bits that counts.
pub const CENSUS_BITS: u32 = 40;
/// Cost units of the largest colour difference, where colour has its full weight.
pub const COLOUR_WEIGHT: u32 = 48;
/// Truncation of the colour difference, in 8-bit levels summed over the channels.
pub const COLOUR_MOST: u32 = 64;
/// Horizontal radius of the window of census and contrast, which is 9 x 7.
pub const CENSUS_RADIUS_X: u32 = 4;
/// Vertical radius of that window.
pub const CENSUS_RADIUS_Y: u32 = 3;
/// Number of pixels in that window.
pub const CENSUS_PLACES: u32 = (2 * CENSUS_RADIUS_X + 1) * (2 * CENSUS_RADIUS_Y + 1);
/// Fractional bits of the costs of level 1 and coarser.
pub const COST_FRACTION_BITS: u32 = 8;
/// Rows that a device keeps together where it holds only some of level 0 at a time.
pub const RING_PART: usize = 32;
/// Rows of all that a device holds begin at multiples of this many bytes, as its bindings do.
pub const ROW_ALIGN: usize = 256;
/// Side of the window that holds a dependency factor's members.
pub const GRAPH_WINDOW: usize = 7;
/// Labels are stored in blocks of this many; the last block is padded.
pub const LABEL_BLOCK: usize = 16;
/// Pixels of a row that share a label window.
pub const WINDOW_RUN: usize = 8;
/// The first label of a label window is a multiple of this.
pub const WINDOW_STEP: usize = 4;
/// How far above a pixel's smallest belief a label may be and still count as a candidate, in units: 2 nats.
pub const WINDOW_SLACK: u16 = 8;
/// How far from its own coarse pixels a label window looks for candidates, in coarse pixels.
pub const WINDOW_REACH: usize = 2;
/// Labels that a label window holds at least on either side of each candidate.
pub const WINDOW_MARGIN: i32 = 2;

// The largest costs of a label match what the options state.
const _: () = assert!(MatchingCost::Sad.most() as u32 == COST_MAX as u32);
const _: () = assert!(
    (MatchingCost::AdCensus.most() * CENSUS_UNITS) as u32 == CENSUS_BITS * CENSUS_BIT_COST + COLOUR_WEIGHT
);
const _: () = assert!(255 + (GRAPH_WINDOW * GRAPH_WINDOW + 3) as u32 * HARD_CAP as u32 <= u16::MAX as u32);

/// Size of one level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LevelPlan {
    /// Width in pixels, ceil(W / 2^z).
    pub width: usize,
    /// Height in pixels, ceil(H / 2^z).
    pub height: usize,
    /// Smallest label, floor(min / 2^z).
    pub min: i32,
    /// Number of labels, up to ceil(max / 2^z).
    pub labels: usize,
    /// Labels with padding: `labels` rounded up to whole blocks of [`LABEL_BLOCK`].
    pub stride: usize,
    /// Conversion from cost to evidence at this level.
    pub evidence: EvidenceScale,
}

impl LevelPlan {
    /// Number of pixels.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// Labels of all pixels, padding included.
    #[must_use]
    pub fn cells(&self) -> u64 {
        (self.pixels() * self.stride) as u64
    }

    /// Groups of four labels, padding included.
    #[must_use]
    pub fn quads(&self) -> usize {
        self.stride / 4
    }

    /// Largest label.
    #[must_use]
    pub fn max(&self) -> i32 {
        self.min + self.labels as i32 - 1
    }

    /// Label windows of the level: those of a row, and rows of them.
    #[must_use]
    pub fn windows(&self) -> (usize, usize) {
        (self.width.div_ceil(WINDOW_RUN), self.height.div_ceil(2))
    }
}

/// Conversion from cost to evidence in 16-bit steps. With c in 1/256 cost units and D = min(c(d) - min c,
/// `limit`), e(d) = min(((D << `up`) * `multiplier` >> 16) + (1 << `down` >> 1) >> `down`, `cap`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EvidenceScale {
    /// Evidence units per 1/256 cost unit, times 2^(16 + `down` - `up`); below 2^15.
    pub multiplier: u16,
    /// The smallest cost difference that reaches the cap; larger differences are clamped to it.
    pub limit: u16,
    /// The largest shift that keeps `limit` in 16 bits.
    pub up: u32,
    /// Fractional bits of the product.
    pub down: u32,
    /// Largest evidence, in units.
    pub cap: u8,
}

impl EvidenceScale {
    fn new(gain: f64, cost_units: f64, method: &Method) -> Self {
        let per_cost = gain * UNITS_PER_NAT / (method.messages.temperature * cost_units * 256.0);
        let cap = (method.messages.evidence_cap * UNITS_PER_NAT + 0.5).floor();
        let limit = (cap / per_cost).ceil().clamp(1.0, u16::MAX.into()) as u16;
        let up = limit.leading_zeros();
        let unshifted = per_cost * 65536.0 / f64::from(1u32 << up);
        // The multiplier uses all of 15 bits, so that product and rounding fit in 16.
        let mut down = 0;
        while down < 15 && unshifted * f64::from(2u32 << down) < 32767.0 {
            down += 1;
        }
        let multiplier = (unshifted * f64::from(1u32 << down) + 0.5).floor().clamp(1.0, 32767.0) as u16;
        Self { multiplier, limit, up, down, cap: cap as u8 }
    }

    /// Evidence for a cost `difference` above the pixel's cheapest label, in 1/256 cost units.
    #[must_use]
    #[inline]
    pub fn apply(self, difference: u16) -> u8 {
        let product = (u32::from(difference.min(self.limit) << self.up) * u32::from(self.multiplier)) >> 16;
        // Both fit in 15 bits.
        let e = (product as u16 + (1 << self.down >> 1)) >> self.down;
        e.min(self.cap.into()) as u8
    }
}

/// Storage width of messages and beliefs, which is also where their sums saturate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum VolumeWidth {
    /// 8 bits.
    Narrow,
    /// 16 bits.
    Wide,
}

impl VolumeWidth {
    /// Bytes per value.
    #[must_use]
    pub fn bytes(self) -> usize {
        match self {
            Self::Narrow => 1,
            Self::Wide => 2,
        }
    }

    /// The largest value, which stands for infinity.
    #[must_use]
    pub fn most(self) -> u16 {
        match self {
            Self::Narrow => u8::MAX.into(),
            Self::Wide => u16::MAX,
        }
    }
}

/// Truncation of a sum of messages s to a message m(d) = min(s(d), high) - low. Where the sum is infinite, the
/// message is tau.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Truncation {
    /// Cost of disagreement, in units.
    pub tau: u16,
    /// Where the sum is truncated.
    pub rule: TruncationRule,
}

/// Where a message is truncated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TruncationRule {
    /// At tau above the smallest sum, which counts as at most infinity less tau: high = min s + tau, low = min s.
    Relative,
    /// At tau, given that the members' messages have minimum 0: high = tau, low = 0.
    Absolute,
}

impl Truncation {
    /// (high, low) for the smallest sum `min`, where `most` is infinite.
    #[must_use]
    pub fn bounds(self, min: u32, most: u32) -> (u32, u32) {
        let tau = u32::from(self.tau);
        match self.rule {
            TruncationRule::Relative => {
                let low = min.min(most - tau);
                (low + tau, low)
            }
            TruncationRule::Absolute => (tau, 0),
        }
    }
}

/// One step of the schedule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Phase {
    /// The finest level that takes part; all coarser ones do too.
    pub finest: usize,
    /// Largest number of iterations.
    pub iterations: u32,
}

/// Everything about a match that is known before it runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The method.
    pub method: Method,
    /// The disparities to search.
    pub range: DisparityRange,
    /// All levels, finest first.
    pub levels: Vec<LevelPlan>,
    /// Neighbours of a dependency factor besides its centre.
    pub neighbours: usize,
    /// Cost of labels outside the right image, in cost units of level 0.
    pub outside_cost: u8,
    /// Truncation of dependency messages.
    pub dependency: Truncation,
    /// Truncation of resolution messages.
    pub resolution: Truncation,
    /// Storage width of messages of both kinds, and of beliefs.
    pub volume_width: VolumeWidth,
    /// The phases of message passing, in order.
    pub phases: Vec<Phase>,
    /// Columns of the left view from which [`Stage::RightView`](crate::backend::Stage::RightView) is
    /// computed: all of them, or in a tile those of its core.
    pub core: Range<usize>,
    /// Rows of level 0 that are held at the same time: all of them, or as many as the stages that go down the image
    /// [together](crate::backend::wavefront) need.
    pub held: usize,
}

impl Plan {
    /// The plan for images of `width` x `height` pixels.
    ///
    /// # Errors
    /// [`crate::Error::Option`] when an option of the method is out of range.
    pub fn new(width: usize, height: usize, range: DisparityRange, method: &Method) -> Result<Self> {
        let method = method.clone().validated()?;
        let cost_units = match method.cost.matching {
            MatchingCost::Sad => 1.0,
            MatchingCost::Census | MatchingCost::AdCensus => CENSUS_UNITS,
        };
        let mut levels = Vec::new();
        let mut gain = 1.0;
        let (mut size, mut min, mut max) = ((width, height), range.min, range.max);
        for _ in 0..method.graph.levels {
            let labels = (max - min + 1) as usize;
            levels.push(LevelPlan {
                width: size.0,
                height: size.1,
                min,
                labels,
                stride: labels.next_multiple_of(LABEL_BLOCK),
                evidence: EvidenceScale::new(gain, cost_units, &method),
            });
            if size.0.max(size.1) == 1 {
                break;
            }
            size = (size.0.div_ceil(2), size.1.div_ceil(2));
            (min, max) = (min.div_euclid(2), -((-max).div_euclid(2)));
            gain *= method.messages.evidence_gain;
        }

        let window = GRAPH_WINDOW * GRAPH_WINDOW;
        // The tolerance makes sure that 48 (1 - 75 / 100) is 12, whatever the last bit of the product.
        let neighbours = (((window - 1) as f64 * (100.0 - method.graph.percentile) / 100.0) - 1e-9)
            .ceil()
            .max(0.0) as usize;
        let cut = |nats: f64| match method.messages.potential {
            Potential::Hard => Truncation { tau: HARD_CAP, rule: TruncationRule::Relative },
            Potential::Soft => Truncation { tau: units(nats), rule: TruncationRule::Relative },
            Potential::Exact => Truncation { tau: units(nats), rule: TruncationRule::Absolute },
        };
        let (dependency, resolution) =
            (cut(method.messages.dependency_truncation), cut(method.messages.resolution_truncation));
        // A pixel is, on average, in as many factors as a factor has members. For such a pixel nothing may
        // saturate.
        let usual = u32::from(levels[0].evidence.cap)
            + (neighbours + 1) as u32 * u32::from(dependency.tau)
            + 2 * u32::from(resolution.tau);
        let most = u32::from(VolumeWidth::Narrow.most() - dependency.tau.max(resolution.tau).min(255));
        let volume_width = if usual <= most { VolumeWidth::Narrow } else { VolumeWidth::Wide };

        let last = levels.len() - 1;
        let phases = match method.schedule.order {
            Order::Together => vec![Phase { finest: 0, iterations: method.schedule.iterations }],
            Order::CoarseFirst => (0..=last)
                .rev()
                .map(|finest| Phase {
                    finest,
                    iterations: if finest == 0 {
                        method.schedule.final_iterations
                    } else {
                        method.schedule.iterations
                    },
                })
                .collect(),
        };
        Ok(Self {
            outside_cost: (method.cost.outside_cost * cost_units + 0.5).floor() as u8,
            range,
            levels,
            neighbours,
            dependency,
            resolution,
            volume_width,
            phases,
            core: 0..width,
            held: height,
            method,
        })
    }

    /// This plan for another image size: same range, method and number of levels.
    pub(crate) fn resized(&self, width: usize, height: usize) -> Self {
        let mut plan = Self { core: 0..width, held: height, ..self.clone() };
        let mut size = (width, height);
        for level in &mut plan.levels {
            (level.width, level.height) = size;
            size = (size.0.div_ceil(2), size.1.div_ceil(2));
        }
        plan
    }

    /// Whether a match by this plan fits the buffers of `other`: the two may differ in [`Plan::core`] only.
    #[must_use]
    pub fn fits(&self, other: &Self) -> bool {
        *self == Self { core: self.core.clone(), ..other.clone() }
    }

    /// Rows of the volumes of `level` that are held at the same time.
    #[must_use]
    pub fn rows_held(&self, level: usize) -> usize {
        if level == 0 { self.held } else { self.levels[level].height }
    }

    /// Parts of a ring, of `part` rows each and with a halo on either side, that hold all rows of level 0 that are needed at the
    /// same time: the first of the next part to be overwritten is that of a halo, and all before it must be done.
    #[must_use]
    pub fn ring_parts(&self, part: usize) -> usize {
        (self.held + 2 * (GRAPH_WINDOW / 2)).div_ceil(part) + 1
    }

    /// The same plan with all rows held.
    #[must_use]
    pub fn whole(&self) -> Self {
        Self { held: self.levels[0].height, ..self.clone() }
    }

    /// Whether all rows of level 0 are held at the same time.
    #[must_use]
    pub fn holds_all_rows(&self) -> bool {
        self.held == self.levels[0].height
    }

    /// (width, height) of the finest level.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        (self.levels[0].width, self.levels[0].height)
    }

    /// Members of a dependency factor: the centre and its neighbours.
    #[must_use]
    pub fn slots(&self) -> usize {
        self.neighbours + 1
    }

    /// The largest belief, at which sums saturate. It is one message below the largest value, so that a
    /// padding label stays above the belief of every real label even after a message has been subtracted.
    #[must_use]
    pub fn belief_most(&self) -> u16 {
        self.volume_width.most() - self.dependency.tau.max(self.resolution.tau)
    }

    /// Whether the texture zones limit the labels of their pixels.
    #[must_use]
    pub fn limits_labels(&self) -> bool {
        self.method.front.zone_sigmas > 0.0
    }

    /// The largest sum of squared changes, over all pixels of the finest level, at which its map has settled; `None` where message
    /// passing goes on anyway.
    #[must_use]
    pub fn settled_change(&self) -> Option<u64> {
        let tolerance = self.method.schedule.tolerance;
        (tolerance > 0.0).then(|| (tolerance * tolerance * self.levels[0].pixels() as f64).floor() as u64)
    }

    /// Whether the label windows of `level` follow the beliefs of the next coarser one.
    #[must_use]
    pub fn windows_follow_beliefs(&self, level: usize) -> bool {
        self.method.schedule.order == Order::CoarseFirst && level + 1 < self.levels.len()
    }

    /// Whether the labels of the right view are read off the beliefs.
    #[must_use]
    pub fn reads_right_view(&self) -> bool {
        let refinement = &self.method.refinement;
        match refinement.left_right_check {
            LeftRightCheck::Off => refinement.right_map,
            LeftRightCheck::RightView => true,
            LeftRightCheck::SecondMatch => false,
        }
    }

    /// Cost units of the largest colour difference at full weight: [`COLOUR_WEIGHT`], or 0 without colour.
    #[must_use]
    pub fn colour_weight(&self) -> u32 {
        if self.method.cost.matching == MatchingCost::AdCensus { COLOUR_WEIGHT } else { 0 }
    }

    /// The variance of grey (in squared 8-bit levels, times [`CENSUS_PLACES`] squared) from which on colour
    /// has its full weight.
    #[must_use]
    pub fn colour_variance(&self) -> u32 {
        let contrast = self.method.cost.colour_contrast;
        (f64::from(CENSUS_PLACES * CENSUS_PLACES) * (contrast * contrast) + 0.5).floor() as u32
    }

    /// Whether the pyramid takes the minimum over d instead of a low-pass.
    #[must_use]
    pub fn minimum_over_d(&self) -> bool {
        self.method.cost.pyramid == Pyramid::Minimum
    }

    /// Whether odd labels agree with both of their coarse neighbours.
    #[must_use]
    pub fn interpolating(&self) -> bool {
        self.method.messages.agreement == Agreement::Interpolating
    }

    /// `2 z_min - d_min` between `level` - 1 and `level`: 0, or -1 where the finer level's smallest label is odd.
    /// Coarse label index j agrees best with the fine label index 2 j + offset.
    #[must_use]
    pub fn label_offset(&self, level: usize) -> i32 {
        2 * self.levels[level].min - self.levels[level - 1].min
    }

    /// Largest number of bytes taken by the volumes and the graph of `level`, on the CPU path or on a device; where not all rows of
    /// level 0 are held, with what its costs are computed from.
    #[must_use]
    pub fn level_bytes(&self, level: usize) -> u64 {
        let l = &self.levels[level];
        let streamed = self.rows_held(level) < l.height;
        let halo = GRAPH_WINDOW / 2;
        // The ring of the CPU path is shorter.
        let rows = if streamed { self.ring_parts(RING_PART) * (RING_PART + 2 * halo) } else { l.height };
        let width = self.volume_width.bytes();
        let has = |is_there: bool| usize::from(is_there);
        // Cost, evidence, beliefs with the messages from above and below, and the messages of the factors.
        let cost = if level == 0 { 1 } else { 2 };
        let messages = 1 + has(level > 0);
        let labels = l.width * l.stride;
        let row =
            (cost + 1 + width * (1 + messages)) * aligned(labels) + width * aligned(self.slots() * labels);
        let features = if streamed { l.height * (2 * l.width + 24 * (l.width + 2 * l.stride)) } else { 0 };
        // The member codes, and the transposed table with its row starts, and the guide.
        let on_host = l.width * (self.neighbours + 4 * self.slots() + 4 + 9);
        // A device needs less for these, but keeps candidates and label ranges as well. The guide of level 1 is there twice, and that of
        // level 0 is a map.
        let guides = [0, 2, 1][level.min(2)];
        let maps = 2 + 4 * guides + has(level > 0) + has(self.limits_labels());
        let on_device = maps * aligned(4 * l.width) + aligned(4 * l.width * self.neighbours.div_ceil(4));
        let (runs, window_rows) = l.windows();
        let windows = 2 * aligned(4 * runs * window_rows);
        (rows * row + features + l.height * on_host.max(on_device) + windows) as u64
    }

    /// Largest number of bytes taken by the images and all maps.
    #[must_use]
    pub fn map_bytes(&self) -> u64 {
        // The maps of the left view, and both views mirrored, while those of the right view are made.
        let right = if self.method.refinement.right_map { 10 + 2 * 9 } else { 0 };
        let (width, height) = self.size();
        // Beside them, what a device keeps of each row, and its tables.
        ((100 + right) * width.next_multiple_of(ROW_ALIGN / 4) * height + 16 * height + (1 << 14)) as u64
    }

    /// Largest number of bytes that the host takes besides the pair before it hands it to a backend. Per pixel: 66 to
    /// correct the illumination (48 for one view, 18 for the corrected pair), and 200 to find texture zones
    /// (spectrum and responses).
    #[must_use]
    pub fn front_bytes(&self) -> u64 {
        let corrected = if self.method.front.illumination == Illumination::None { 0 } else { 66 };
        let zones = if self.limits_labels() { 200 } else { 0 };
        (corrected + zones) * self.levels[0].pixels() as u64
    }

    /// Bytes of the pair: 18 per pixel, for two views of 8 and their masks.
    #[must_use]
    pub fn pair_bytes(&self) -> u64 {
        18 * self.levels[0].pixels() as u64
    }

    /// Largest number of bytes taken by the maps of an image that is matched tile by tile. A pixel takes 20
    /// in the maps that the tiles write and those derived from them (label, best, runner-up, right label and
    /// its belief 2 each, raw and final disparity 4 each, validity and confidence 1 each), and 12 while they
    /// are made; 9 more where the left view is corrected.
    #[must_use]
    pub fn mosaic_bytes(&self) -> u64 {
        let corrected = if self.method.front.illumination == Illumination::None { 0 } else { 9 };
        // Disparities of the right view, its image and its maps.
        let right = if self.method.refinement.right_map { 4 + 2 * 9 + 12 } else { 0 };
        (20 + 12 + corrected + right) * self.levels[0].pixels() as u64
    }

    /// Bytes taken by all volumes, graphs and maps together.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.map_bytes() + (0..self.levels.len()).map(|z| self.level_bytes(z)).sum::<u64>()
    }
}

/// Bytes of a row with its padding.
fn aligned(bytes: usize) -> usize {
    bytes.next_multiple_of(ROW_ALIGN)
}

/// A truncation in units, at least 1.
fn units(nats: f64) -> u16 {
    ((nats * UNITS_PER_NAT + 0.5).floor() as u16).clamp(1, HARD_CAP)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(w: usize, h: usize, min: i32, max: i32) -> Plan {
        Plan::new(w, h, DisparityRange::new(min, max).unwrap(), &Method::default()).unwrap()
    }

    #[test]
    fn levels_cover_the_range_and_the_image() {
        let p = plan(450, 375, -5, 59);
        assert_eq!(p.levels.len(), 6);
        for z in 1..p.levels.len() {
            let (fine, coarse) = (p.levels[z - 1], p.levels[z]);
            assert_eq!(coarse.width, fine.width.div_ceil(2));
            assert_eq!(coarse.height, fine.height.div_ceil(2));
            assert!(2 * coarse.min <= fine.min && 2 * coarse.max() >= fine.max());
            assert!((-1..=0).contains(&p.label_offset(z)));
            for d in fine.min..=fine.max() {
                assert!((coarse.min..=coarse.max()).any(|label| (d - 2 * label).abs() <= 1));
            }
        }
        assert_eq!((p.levels[3].min, p.levels[3].max()), (-1, 8));
    }

    #[test]
    fn percentiles_count_neighbours() {
        for (percentile, count) in [(97.0, 2), (92.0, 4), (84.0, 8), (75.0, 12), (100.0, 0), (0.0, 48)] {
            let mut method = Method::default();
            method.graph.percentile = percentile;
            let p = Plan::new(9, 9, DisparityRange::new(0, 3).unwrap(), &method).unwrap();
            assert_eq!(p.neighbours, count, "{percentile} %");
        }
    }

    #[test]
    fn tiny_images_have_fewer_levels() {
        assert_eq!(plan(1, 1, 0, 0).levels.len(), 1);
        assert_eq!(plan(1, 3, 0, 7).levels.len(), 3);
    }

    #[test]
    fn evidence_is_monotone_and_reaches_its_cap() {
        for temperature in [0.001, 0.15, 0.8, 40.0] {
            let mut method = Method::default();
            method.messages.temperature = temperature;
            for gain in [1.0, 243.0] {
                let scale = EvidenceScale::new(gain, CENSUS_UNITS, &method);
                let mut last = 0;
                for difference in 0..=u16::MAX {
                    let e = scale.apply(difference);
                    assert!(e >= last && e <= scale.cap);
                    let exact = f64::from(difference) * gain * 4.0 / (temperature * 127.0 * 256.0);
                    let error = (f64::from(e) - exact.min(32.0)).abs();
                    assert!(error <= 0.51 + 0.01 * exact.min(32.0), "{difference}: {e} against {exact}");
                    last = e;
                }
            }
        }
    }

    #[test]
    fn the_paper_needs_wide_volumes_and_the_default_narrow_ones() {
        let range = DisparityRange::new(0, 59).unwrap();
        let paper = Plan::new(450, 375, range, &Method::preset("paper").unwrap()).unwrap();
        assert_eq!(paper.volume_width, VolumeWidth::Wide);
        assert_eq!(plan(450, 375, 0, 59).volume_width, VolumeWidth::Narrow);
    }
}
