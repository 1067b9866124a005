//! All properties of a match that are known before it runs: levels, integer parameters, bounds, memory.
//!
//! A plan depends only on the image size, the disparity range and the [`Method`]. It is the same on every
//! machine, can be tested without a device, and is the output of `--dry-run`.
//!
//! # Units
//! Messages, evidence and beliefs are costs: the -log of the paper's probabilities, in [`UNITS_PER_NAT`]
//! units per nat. All are non-negative integers, and the minimum of every message over the labels is 0. They
//! and their sums are stored in 8 bits, or in 16 if the method needs them ([`VolumeWidth`]). Sums saturate; a
//! label whose cost saturates is no longer a candidate, so its exact cost does not matter.

mod arithmetic;
pub mod patches;
pub(crate) mod planes;
pub(crate) mod support;
pub mod votes;

use crate::error::Result;
use crate::maps::FRACTION;
use crate::options::{
    Agreement, DisparityRange, Fill, LeftRightCheck, MatchSize, MatchingCost, Method, Order, Potential,
    Pyramid,
};
use std::ops::Range;

pub(crate) use arithmetic::EvidenceScale;
use arithmetic::units;
pub use arithmetic::{HARD_CAP, Truncation, TruncationRule, UNITS_PER_NAT, VolumeWidth};

/// Largest matching cost at level 0, in cost units.
pub const COST_MAX: u8 = 254;
/// Cost units per differing census bit.
pub(crate) const CENSUS_BIT_COST: u32 = 4;
/// Largest number of differing census bits that counts.
pub(crate) const CENSUS_BITS: u32 = 40;
/// Truncation of the colour difference, in 8-bit levels summed over the channels.
pub(crate) const COLOUR_MOST: u32 = 64;
/// Horizontal radius of the 9 x 7 window of census and contrast.
pub(crate) const CENSUS_RADIUS_X: u32 = 4;
/// Vertical radius of the window of census and contrast.
pub(crate) const CENSUS_RADIUS_Y: u32 = 3;
/// Number of pixels in the window of census and contrast.
pub(crate) const CENSUS_PLACES: u32 = (2 * CENSUS_RADIUS_X + 1) * (2 * CENSUS_RADIUS_Y + 1);
/// Fractional bits of the costs of level 1 and coarser.
pub(crate) const COST_FRACTION_BITS: u32 = 8;
/// Rows per part of the ring on a device that holds only some rows of level 0 at a time.
pub(crate) const RING_PART: usize = 32;
/// Rows on a device start at multiples of this many bytes, like bindings.
pub(crate) const ROW_ALIGN: usize = 256;
/// Side of the window that holds a dependency factor's members.
pub(crate) const GRAPH_WINDOW: usize = 7;
/// Labels are stored in blocks of this many; the last block is padded.
pub(crate) const LABEL_BLOCK: usize = 16;
/// Pixels of a row that share a label window.
pub(crate) const WINDOW_RUN: usize = 8;
/// The first label of a label window is a multiple of this.
pub(crate) const WINDOW_STEP: usize = 4;
/// Candidates are labels at most this far above the pixel's smallest belief, in units: 2 nats.
pub(crate) const WINDOW_SLACK: u16 = 8;
/// Radius of the search for candidates around a label window's coarse pixels, in coarse pixels.
pub(crate) const WINDOW_REACH: usize = 2;
/// Minimum number of labels in a window on either side of each candidate.
pub(crate) const WINDOW_MARGIN: i32 = 2;
/// Bits of the fraction of a label in a prior's interval.
pub(crate) const PRIOR_LABEL_BITS: u32 = 5;
/// Bits of the fraction of a unit in the slope of a prior.
pub(crate) const PRIOR_SLOPE_BITS: u32 = 4;
/// Largest slope of a prior, in fractions of a unit per label.
pub(crate) const PRIOR_SLOPE_MOST: u32 = (1 << 12) - 1;
/// Largest distance from the interval of a prior that counts, in fractions of a label.
pub(crate) const PRIOR_REACH: u32 = (1 << 16) - 1;

// The largest costs of a label agree with the facts in the options.
const _: () = {
    let (sad, ad_census) = (MatchingCost::Sad.facts(), MatchingCost::AdCensus.facts());
    assert!((sad.most * sad.units) as u32 == COST_MAX as u32);
    let census = CENSUS_BITS * CENSUS_BIT_COST;
    assert!((ad_census.most * ad_census.units) as u32 == census + ad_census.colour_weight);
};
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
    /// Labels with padding: `labels` rounded up to whole blocks of `LABEL_BLOCK`.
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

    /// (windows per row, rows of windows).
    #[must_use]
    pub fn windows(&self) -> (usize, usize) {
        (self.width.div_ceil(WINDOW_RUN), self.height.div_ceil(2))
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

/// The full size and range of a pair that is matched at half its size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FullSize {
    /// (width, height) of both views, in pixels.
    pub size: (usize, usize),
    /// The disparities to search, in pixels.
    pub range: DisparityRange,
}

/// All properties of a match that are known before it runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The method.
    pub method: Method,
    /// The disparities to search, at the size of the finest level.
    pub range: DisparityRange,
    /// The full size and range of the pair, if it is matched at half its size.
    pub full: Option<FullSize>,
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
    /// Columns of the left view that the right view is computed from: all, or those of the core of a tile.
    pub core: Range<usize>,
    /// Number of rows of level 0 held at the same time: all, or as many as the stages that run together need.
    pub held: usize,
    /// Whether all costs of level 0 are held, even if its other volumes are not.
    pub holds_costs: bool,
    /// Memory for the match, in MiB: the limit of the method, or the rest of it that a tile may use.
    pub memory: u32,
    /// Whether data that are never needed at the same time share memory.
    pub shares: bool,
    /// Whether a [prior](crate::prior::Prior) of the scene is added to the evidence.
    pub prior: bool,
}

impl Plan {
    /// The plan for images of `width` x `height` pixels. If the method matches at half their size, so are the levels.
    ///
    /// # Errors
    /// [`crate::Error::Option`] when an option of the method is out of range.
    pub fn new(width: usize, height: usize, range: DisparityRange, method: &Method) -> Result<Self> {
        let method = method.clone().validated()?;
        let halves = method.schedule.match_size == MatchSize::Half;
        let full = halves.then_some(FullSize { size: (width, height), range });
        let (width, height, range) = if halves {
            (width.div_ceil(2), height.div_ceil(2), range.halved())
        } else {
            (width, height, range)
        };
        let cost_units = method.cost.units();
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
        // The tolerance makes 48 (1 - 75 / 100) equal 12, regardless of rounding.
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
        // On average, a pixel is in as many factors as a factor has members. Such a pixel must not saturate.
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
            full,
            levels,
            neighbours,
            dependency,
            resolution,
            volume_width,
            phases,
            core: 0..width,
            held: height,
            holds_costs: false,
            memory: method.tiles.memory,
            shares: false,
            prior: false,
            method,
        })
    }

    /// The plan for the same pair at twice its size, if the method also matches there.
    ///
    /// # Errors
    /// [`crate::Error::Range`] if there are too many labels.
    pub fn doubled(&self) -> Result<Option<Self>> {
        let Some(method) = self.method.at_double_size() else { return Ok(None) };
        let (width, height) = self.size();
        let plan = Self::new(2 * width, 2 * height, self.range.doubled()?, &method)?;
        Ok(Some(plan.with_prior(self.prior)))
    }

    /// This plan, with or without a prior of the scene.
    #[must_use]
    pub fn with_prior(self, prior: bool) -> Self {
        Self { prior, ..self }
    }

    /// Number of looks at the pair: one if nothing is filled in, since the next would see the same, and if message passing may stop
    /// early, since it then takes all iterations that it needs.
    #[must_use]
    pub fn looks(&self) -> u32 {
        let looks_again = self.method.refinement.fill != Fill::None && self.settled_change().is_none();
        if looks_again { self.method.schedule.looks } else { 1 }
    }

    /// Whether any look adds a prior to the evidence.
    #[must_use]
    pub fn has_priors(&self) -> bool {
        self.prior || self.looks() > 1
    }

    /// Whether the costs of a level and its messages share memory on the CPU path: not if another look needs the costs again.
    #[must_use]
    pub fn costs_share(&self) -> bool {
        self.shares && self.looks() == 1
    }

    /// Size and disparity range of the pair.
    #[must_use]
    pub fn of_pair(&self) -> FullSize {
        self.full.unwrap_or(FullSize { size: self.size(), range: self.range })
    }

    /// Whether all disparities of the maps, as 1/256 px above the lowest one, fit in 16 bits, in which a device packs them before
    /// they are read back. The anchors of a prior may be outside the range.
    #[must_use]
    pub fn packs_maps(&self) -> bool {
        let range = self.of_pair().range;
        !self.prior && FRACTION * (range.max - range.min) <= i32::from(u16::MAX)
    }

    /// This plan for another size of the finest level: same range, method and number of levels.
    pub(crate) fn resized(&self, width: usize, height: usize) -> Self {
        let full = self.full.map(|full| FullSize { size: (2 * width, 2 * height), ..full });
        let mut plan = Self { core: 0..width, held: height, full, ..self.clone() };
        let mut size = (width, height);
        for level in &mut plan.levels {
            (level.width, level.height) = size;
            size = (size.0.div_ceil(2), size.1.div_ceil(2));
        }
        plan
    }

    /// This plan with a memory limit of `memory` MiB.
    pub(crate) fn granted(&self, memory: u32) -> Self {
        let mut plan = Self { memory, ..self.clone() };
        plan.method.tiles.memory = memory;
        plan
    }

    /// Whether a match by this plan can use the buffers of `other`: they may differ only in [`Plan::core`].
    #[must_use]
    pub fn fits(&self, other: &Self) -> bool {
        *self == Self { core: self.core.clone(), ..other.clone() }
    }

    /// Rows of the volumes of `level` that are held at the same time.
    #[must_use]
    pub fn rows_held(&self, level: usize) -> usize {
        if level == 0 { self.held } else { self.levels[level].height }
    }

    /// This plan with all rows held.
    #[must_use]
    pub fn whole(&self) -> Self {
        Self { held: self.levels[0].height, ..self.clone() }
    }

    /// Whether all rows of level 0 are held at the same time.
    #[must_use]
    pub fn holds_all_rows(&self) -> bool {
        self.held == self.levels[0].height
    }

    /// Whether all costs of level 0 are stored, not computed where they are read.
    #[must_use]
    pub fn stores_costs(&self) -> bool {
        self.holds_all_rows() || self.holds_costs
    }

    /// Whether the dependency factors of `level` ever send messages; otherwise its graph is not needed.
    #[must_use]
    pub fn floods(&self, level: usize) -> bool {
        self.phases.iter().any(|phase| phase.finest <= level && phase.iterations > 0)
    }

    /// Cost of labels that differ by one in a dependency factor of `level`, in units. `None` if they cost as much as any
    /// disagreement: at the finest level, whose labels are fine enough for one surface, and if the potential is not soft.
    #[must_use]
    pub fn label_step(&self, level: usize) -> Option<u16> {
        let messages = &self.method.messages;
        let step = units(messages.label_step);
        (level > 0 && messages.potential == Potential::Soft && step < self.dependency.tau).then_some(step)
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

    /// The largest belief, at which sums saturate. It is one message below the largest value, so that padding
    /// stays above every label even after a message is subtracted.
    #[must_use]
    pub fn belief_most(&self) -> u16 {
        self.volume_width.most() - self.dependency.tau.max(self.resolution.tau)
    }

    /// Whether the texture zones limit the labels of their pixels.
    #[must_use]
    pub fn limits_labels(&self) -> bool {
        self.method.front.limits_labels()
    }

    /// The largest sum of squared label changes at the finest level that counts as settled; `None` if message
    /// passing never stops early.
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

    /// Whether the labels of the right view are computed from the beliefs.
    #[must_use]
    pub fn reads_right_view(&self) -> bool {
        let refinement = &self.method.refinement;
        match refinement.left_right_check {
            LeftRightCheck::Off => refinement.right_map,
            LeftRightCheck::RightView => true,
            LeftRightCheck::SecondMatch => false,
        }
    }

    /// Cost units of the largest colour difference at full weight, or 0 without colour.
    #[must_use]
    pub fn colour_weight(&self) -> u32 {
        self.method.cost.matching.facts().colour_weight
    }

    /// The variance of grey (in squared 8-bit levels, times `CENSUS_PLACES` squared) above which colour has
    /// full weight.
    #[must_use]
    pub fn colour_variance(&self) -> u32 {
        let contrast = self.method.cost.colour_contrast;
        (f64::from(CENSUS_PLACES * CENSUS_PLACES) * (contrast * contrast) + 0.5).floor() as u32
    }

    /// Whether costs can be computed row by row, where they are read.
    #[must_use]
    pub fn costs_go_by_rows(&self) -> bool {
        self.method.cost.matching.facts().by_rows
    }

    /// Whether the pyramid takes the minimum over disparities instead of a low-pass.
    #[must_use]
    pub fn minimum_over_d(&self) -> bool {
        self.method.cost.pyramid == Pyramid::Minimum
    }

    /// Whether odd labels agree with both of their coarse neighbours.
    #[must_use]
    pub fn interpolating(&self) -> bool {
        self.method.messages.agreement == Agreement::Interpolating
    }

    /// `2 z_min - d_min` between `level` - 1 and `level`: 0, or -1 if the finer level's smallest label is
    /// odd. Coarse label index j agrees best with the fine label index 2 j + offset.
    #[must_use]
    pub fn label_offset(&self, level: usize) -> i32 {
        2 * self.levels[level].min - self.levels[level - 1].min
    }
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
                let scale = EvidenceScale::new(gain, method.cost.units(), &method);
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

    /// Evidence of the paper at level 0, in units by steps of the cost: 10 nats per 8-bit level, up to 8 nats.
    #[test]
    fn the_prior_of_the_paper_is_graded() {
        let range = DisparityRange::new(0, 59).unwrap();
        let values = |method: &Method| -> Vec<u8> {
            let scale = Plan::new(450, 375, range, method).unwrap().levels[0].evidence;
            (0..=16).map(|steps: u16| scale.apply(steps << COST_FRACTION_BITS)).collect()
        };
        let paper = Method::preset("paper").unwrap();
        let graded = values(&paper);
        for (steps, &e) in graded.iter().enumerate() {
            let exact = (4.0 * 10.0 * steps as f64 / 16.0).min(32.0);
            assert!((f64::from(e) - exact).abs() <= 0.5, "{steps} steps: {e} against {exact}");
        }
        // Control: costs in whole levels have two values, whatever the temperature.
        for temperature in [0.001, 0.1, 0.125] {
            let mut whole = paper.clone();
            (whole.cost.sad_steps, whole.messages.temperature) = (1, temperature);
            assert_eq!(values(&whole)[1..], [32; 16]);
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
