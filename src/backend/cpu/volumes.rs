//! The volumes of a match, in the width that its plan needs.

use super::features::Features;
use super::pages::Pages;
use super::units::Units;
use super::windows::Windows;
use crate::backend::Stage;
use crate::error::Result;
use crate::front::Prepared;
use crate::graph::LevelGraph;
use crate::image::{Image, Pair, Plane};
use crate::plan::Plan;
use crate::program::{Sent, SentMessages};
use crate::stage::prior::LabelPrior;
use crate::stage::{Data, MapSet, Volume};
use std::mem;

/// All volumes of a match.
pub(super) struct Volumes<U> {
    pub(super) plan: Plan,
    pub(super) pair: Pair,
    /// Features for the matching cost, if the costs of level 0 are not stored.
    pub(super) features: Features,
    /// Cost of level 0, if stored; the costs of coarser levels are in `levels`.
    pub(super) fine_cost: Pages<u8>,
    pub(super) levels: Vec<Level<U>>,
    /// The messages that were sent. All others count as 0, whatever is stored.
    pub(super) messages: SentMessages,
    /// First and last label of each pixel, by level; empty if all labels are allowed.
    pub(super) label_ranges: Vec<Plane<[u16; 2]>>,
    /// The prior of each pixel, by level; empty without one.
    pub(super) priors: Vec<Plane<LabelPrior>>,
    /// The label map of the last [`Stage::Change`](crate::backend::Stage::Change), then the sum of squared
    /// changes, and whether the map has settled.
    pub(super) labels: Vec<u16>,
    pub(super) change: Option<u64>,
    pub(super) settled: bool,
    pub(super) maps: MapSet,
}

/// Volumes of one level. Cost is \[y\]\[x\]\[label\] with padded labels; the others hold only the labels of
/// the `windows`, in memory reserved for all labels, which the system commits on use. At level 0 they hold
/// [`Plan::rows_held`] rows.
pub(super) struct Level<U> {
    pub(super) graph: LevelGraph,
    /// The image that the graph was chosen by; `None` at level 0, whose guide is the left image.
    pub(super) guide: Option<Image>,
    pub(super) windows: Windows,
    /// In 1/256 cost units; empty at level 0, and once messages are sent in memory that they [share](Plan::costs_share).
    pub(super) cost: Pages<u16>,
    pub(super) evidence: Pages<u8>,
    pub(super) dependency: Pages<U>,
    /// Empty at the coarsest level.
    pub(super) down: Pages<U>,
    /// Empty at level 0.
    pub(super) up: Pages<U>,
    pub(super) belief: Pages<U>,
}

impl<U: Units> Volumes<U> {
    pub(super) fn new(plan: &Plan, prepared: Prepared) -> Result<Self> {
        let Prepared { pair, label_ranges, prior, .. } = prepared;
        let last = plan.levels.len() - 1;
        let levels = plan
            .levels
            .iter()
            .enumerate()
            .map(|(z, level)| {
                let held = plan.rows_held(z);
                let cells = Windows::most_cells(level, held);
                let cost = if z == 0 { 0 } else { level.pixels() * level.stride };
                // Costs are in the memory of the messages until these are sent.
                let shared = if plan.costs_share() { (2 * cost).div_ceil(size_of::<U>()) } else { 0 };
                Ok(Level {
                    windows: Windows::full(level, held),
                    cost: Pages::new(if plan.costs_share() { 0 } else { cost })?,
                    evidence: Pages::new(cells)?,
                    dependency: Pages::new(shared.max(cells * plan.slots()))?,
                    down: Pages::new(if z == last { 0 } else { cells })?,
                    up: Pages::new(if z == 0 { 0 } else { cells })?,
                    belief: Pages::new(cells)?,
                    graph: LevelGraph::default(),
                    guide: None,
                })
            })
            .collect::<Result<_>>()?;
        let fine = &plan.levels[0];
        let fine_cost = Pages::new(if plan.stores_costs() { fine.pixels() * fine.stride } else { 0 })?;
        let mut maps = MapSet::new(plan);
        let priors = maps.take_prior(prior);
        let of_maps = Self::of_maps(plan, pair, maps);
        Ok(Self { fine_cost, levels, label_ranges, priors, labels: vec![0; fine.pixels()], ..of_maps })
    }

    /// Maps without volumes.
    pub(super) fn of_maps(plan: &Plan, pair: Pair, maps: MapSet) -> Self {
        Self {
            plan: plan.clone(),
            pair,
            features: Features::default(),
            fine_cost: Pages::default(),
            levels: Vec::new(),
            messages: SentMessages::none(plan.levels.len()),
            label_ranges: Vec::new(),
            priors: Vec::new(),
            labels: Vec::new(),
            change: None,
            settled: false,
            maps,
        }
    }

    /// Frees graphs, guides, label ranges and priors.
    pub(super) fn release(&mut self) {
        (self.label_ranges, self.priors) = (Vec::new(), Vec::new());
        for level in &mut self.levels {
            (level.graph, level.guide) = (LevelGraph::default(), None);
        }
    }

    /// Moves shared memory to the volume that `stage` writes.
    pub(super) fn make_room(&mut self, stage: Stage) {
        for volume in stage.writes().filter_map(Data::volume).filter(|_| self.plan.costs_share()) {
            let Level { cost, dependency, .. } = &mut self.levels[volume.level()];
            match volume {
                Volume::Cost(1..) if cost.is_empty() => *cost = mem::take(dependency).of_others(),
                Volume::Dependency(_) if dependency.is_empty() => *dependency = mem::take(cost).of_others(),
                _ => {}
            }
        }
    }

    /// Starts a stage: returns the messages sent so far, and marks its own as sent.
    pub(super) fn begin(&mut self, stage: Stage) -> Sent {
        let sent = self.messages.at(stage);
        self.messages.send(stage);
        sent
    }

    /// Resets everything to the state after [`Self::new`], for another pair whose plan fits.
    pub(super) fn reset(&mut self, plan: &Plan, prepared: Prepared) {
        let Prepared { pair, label_ranges, prior, .. } = prepared;
        self.plan = plan.clone();
        (self.pair, self.label_ranges) = (pair, label_ranges);
        self.priors = self.maps.take_prior(prior);
        self.labels.fill(0);
        (self.change, self.settled) = (None, false);
        self.messages = SentMessages::none(plan.levels.len());
        for (z, (level, l)) in self.levels.iter_mut().zip(&plan.levels).enumerate() {
            (level.graph, level.guide) = (LevelGraph::default(), None);
            level.windows = Windows::full(l, plan.rows_held(z));
        }
    }
}
