//! The result of a match.

use crate::backend::{Backend, Stage, Traffic};
use crate::engine::Solution;
use crate::error::Error;
use crate::front::check::{self, Warning};
use crate::front::conditioning::Conditioning;
use crate::image::Plane;
use crate::maps::Maps;
use crate::options::DisparityRange;
use crate::plan::Plan;
use crate::prior::PriorUse;
use crate::program::tiles::Tiles;
use crate::sigma::Sigma;
use std::time::Duration;

/// The maps of a pair, and how they were computed.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Matched {
    /// The maps.
    pub maps: Maps,
    /// Iterations done, of all phases together; the most of any tile.
    pub iterations: u32,
    /// The corrections that were made to the pair before it was matched.
    pub conditioning: Conditioning,
    /// How much of the [prior](crate::Job::prior) was used; `None` without one.
    pub prior: Option<PriorUse>,
    /// The plan of the whole image; [`Plan::doubled`] is its plan at twice the size.
    #[doc(hidden)]
    pub plan: Plan,
    /// Whether sparse matches found the range.
    pub range_found: bool,
    /// The tiles of the image: one if it was not cut. Of an image in blocks, those of the block with the most.
    #[doc(hidden)]
    pub tiles: Tiles,
    /// Number of [blocks](crate::region::Blocks) that were matched one by one: 1 if the image fits in the memory of the method.
    pub blocks: usize,
    /// The backend that ran the stages, in readable form.
    pub ran_on: String,
    /// The driver of the device, if known; `None` for the CPU path.
    pub driver: Option<String>,
    /// Why the match did not run on the preferred device, if so.
    pub note: Option<Error>,
    /// The time of every stage, in the order of their first run; empty if they were not timed.
    pub timings: Vec<Timing>,
    /// Data that went through the device.
    #[doc(hidden)]
    pub traffic: Traffic,
    /// Labels that the volumes of each level held, over all pixels, with padding; summed over all tiles.
    pub cells: Vec<u64>,
}

/// The time that a stage took, over all its runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timing {
    /// The stage, or a host step between stages: "illumination", "upload", "zones" and the like.
    pub stage: &'static str,
    /// Its level, if it has one.
    pub level: Option<usize>,
    /// Number of runs.
    pub runs: u32,
    /// Time of all runs, by the device's clock if it has one.
    pub time: Duration,
}

impl Matched {
    pub(super) fn new(
        backend: &dyn Backend,
        tiles: &Tiles,
        solution: Solution,
        timings: Vec<Timing>,
    ) -> Self {
        Self {
            timings,
            traffic: solution.traffic,
            cells: solution.cells,
            maps: solution.maps,
            iterations: solution.iterations,
            conditioning: solution.conditioning,
            prior: solution.prior,
            plan: tiles.whole().clone(),
            range_found: false,
            tiles: tiles.clone(),
            blocks: 1,
            ran_on: backend.describe(),
            driver: backend.driver(),
            note: None,
        }
    }

    /// The disparity of every pixel of the left view, in pixels; `+inf` where there is none.
    #[must_use]
    pub fn disparity(&self) -> Plane<f32> {
        self.maps.final_map()
    }

    /// The disparity before post-processing, in pixels; `+inf` on masked pixels.
    #[must_use]
    pub fn raw(&self) -> Plane<f32> {
        self.maps.raw_map()
    }

    /// The lead of the best label over its runner-up, in 1/8 nat, 0 to 255, averaged over the neighbourhood;
    /// pixels there with another disparity count 0. It is 0 where nothing was measured.
    #[must_use]
    pub fn confidence(&self) -> &Plane<u8> {
        &self.maps.confidence
    }

    /// The expected error of every measured disparity, in pixels, from its confidence; `+inf` where nothing was measured.
    #[must_use]
    pub fn sigma(&self) -> Plane<f32> {
        Sigma::for_method(&self.plan.method).map(&self.maps)
    }

    /// The state of each pixel: bits of [`flag`](crate::maps::flag), 0 where it is measured and trusted.
    #[must_use]
    pub fn validity(&self) -> &Plane<u8> {
        &self.maps.validity
    }

    /// The disparities that were searched.
    #[must_use]
    pub fn range(&self) -> DisparityRange {
        self.plan.of_pair().range
    }

    /// The likely faults of the pair or the range, from the maps, and of the prior.
    #[must_use]
    pub fn warnings(&self) -> Vec<Warning> {
        let (looks, prior) = (self.plan.looks(), self.prior.as_ref());
        check::warnings_of_match(&self.maps, self.range(), looks, self.range_found, prior)
    }
}

/// Sums the times by stage and level.
pub(super) fn summed(solution: &Solution, times: &[(Stage, Duration)]) -> Vec<Timing> {
    let mut all: Vec<Timing> = Vec::new();
    let host = solution.host_times.iter().map(|&(name, time)| (name, None, time));
    let stages =
        times.iter().chain(&solution.mosaic_times).map(|&(stage, time)| (stage.name(), stage.level(), time));
    for (stage, level, time) in host.chain(stages) {
        match all.iter_mut().find(|t| (t.stage, t.level) == (stage, level)) {
            Some(timing) => {
                timing.runs += 1;
                timing.time += time;
            }
            None => all.push(Timing { stage, level, runs: 1, time }),
        }
    }
    all
}
