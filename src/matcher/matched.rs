//! What a match gives.

use crate::backend::{Backend, Stage, Traffic};
use crate::engine::Solution;
use crate::error::Error;
use crate::front::check::{self, Warning};
use crate::front::conditioning::Conditioning;
use crate::image::Plane;
use crate::maps::Maps;
use crate::options::DisparityRange;
use crate::plan::Plan;
use crate::program::tiles::Tiles;
use crate::sigma::Sigma;
use std::time::Duration;

/// The maps of a pair, and what made them.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Matched {
    /// The maps.
    pub maps: Maps,
    /// Iterations done, of all phases together; the most of any tile.
    pub iterations: u32,
    /// What was corrected in the pair before it was matched.
    pub conditioning: Conditioning,
    /// The plan that was followed, for the whole image; [`Plan::doubled`] says by which it was matched at twice its size.
    pub plan: Plan,
    /// Whether sparse matches found the range.
    pub range_found: bool,
    /// How the image was cut for it: one tile where it was not.
    pub tiles: Tiles,
    /// What ran the stages, for people.
    pub ran_on: String,
    /// The driver of the device that did, as far as it says; `None` for the CPU path.
    pub driver: Option<String>,
    /// Why it did not run on the preferred device, where that is so.
    pub note: Option<Error>,
    /// The time of every stage, in the order of their first run; empty unless they were asked for.
    pub timings: Vec<Timing>,
    /// What went through the device.
    pub traffic: Traffic,
    /// Labels of all pixels that the volumes of each level held, with padding; those of all tiles together.
    pub cells: Vec<u64>,
}

/// The time that a stage took, over all its runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timing {
    /// The stage, or what the host does around the stages: "illumination", "upload", "zones" and the like.
    pub stage: &'static str,
    /// Its level, where it has one.
    pub level: Option<usize>,
    /// How often it ran.
    pub runs: u32,
    /// All runs together, by the device's own clock where it has one.
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
            plan: tiles.whole().clone(),
            range_found: false,
            tiles: tiles.clone(),
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

    /// How far the best runner-up is behind, in 1/8 nat, 0 to 255, as a mean over the pixels around; those with another disparity
    /// count 0. It is 0 where nothing was measured.
    #[must_use]
    pub fn confidence(&self) -> &Plane<u8> {
        &self.maps.confidence
    }

    /// The error to expect of every measured disparity, in pixels, from its confidence; `+inf` where nothing was measured.
    #[must_use]
    pub fn sigma(&self) -> Plane<f32> {
        Sigma::of(&self.plan.method).map(&self.maps)
    }

    /// Why each pixel is what it is: bits of [`flag`](crate::maps::flag), 0 where it is measured and trusted.
    #[must_use]
    pub fn validity(&self) -> &Plane<u8> {
        &self.maps.validity
    }

    /// The disparities that were searched.
    #[must_use]
    pub fn range(&self) -> DisparityRange {
        self.plan.of_pair().range
    }

    /// What is probably wrong with the pair or the range, as the maps show.
    #[must_use]
    pub fn warnings(&self) -> Vec<Warning> {
        let mut warnings = check::warnings_of(&self.maps, self.range());
        // What is far away has matches: what ends there is wrong, and not cut off.
        warnings.retain(|w| !self.range_found || !matches!(w, Warning::Clipped { upper: false, .. }));
        warnings
    }
}

/// One entry a stage and level.
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
