//! How several stages go down an image together, so that of level 0 only the rows between the first and the last of them are
//! needed.
//!
//! In each step every stage, in the order of the schedule, computes the next [`BAND`] rows. It stays so far behind the one before
//! that what it reads is there, and that nobody needs any more what it overwrites. The results are those of one stage after
//! the other.

use super::Stage;
use crate::plan::{GRAPH_WINDOW, Plan};
use std::ops::Range;

/// Rows of level 0 that each stage of a wavefront computes in a step: enough for the threads to share.
pub const BAND: usize = 32;

/// Stages that go down an image together.
#[derive(Clone, Debug)]
pub struct Wavefront {
    schedule: Vec<Stage>,
    stages: Vec<Stage>,
    /// Rows of level 0 that each stage is behind the first one.
    lags: Vec<usize>,
    /// Height of each level.
    heights: Vec<usize>,
    /// Rows of level 0 that a step computes.
    band: usize,
    /// Rows of level 0 that the last stage reads above its own.
    above: usize,
}

impl Wavefront {
    /// The wavefront of `stages`; `None` where one of them does not go row by row.
    #[must_use]
    pub fn new(plan: &Plan, stages: Vec<Stage>) -> Option<Self> {
        let schedule = stages;
        let stages: Vec<Stage> = schedule.iter().copied().flat_map(parts).collect();
        let level = |stage: &Stage| stage.level().unwrap_or(0);
        // Whole pixels of the coarsest level make whole rows of all.
        let step = 1 << stages.iter().map(level).max().unwrap_or(0);
        let reaches: Vec<usize> = stages
            .iter()
            .map(|stage| reach(*stage).map(|rows| rows << level(stage)))
            .collect::<Option<_>>()?;
        let mut behind = 0;
        let mut lags = Vec::new();
        for (i, &own) in reaches.iter().enumerate() {
            // The one before may still read what this one overwrites.
            let before = if i == 0 { 0 } else { own.max(reaches[i - 1]) };
            behind += before.next_multiple_of(step);
            lags.push(behind);
        }
        let heights = plan.levels.iter().map(|level| level.height).collect();
        let above = reaches.last().copied().unwrap_or(0);
        Some(Self { schedule, stages, lags, heights, band: BAND.next_multiple_of(step), above })
    }

    /// Rows of level 0 that are needed at the same time, at most.
    #[must_use]
    pub fn rows(&self) -> usize {
        (self.band + self.lags.last().unwrap_or(&0) + self.above).min(self.heights[0])
    }

    /// The stages as they were scheduled.
    #[must_use]
    pub fn schedule(&self) -> &[Stage] {
        &self.schedule
    }

    /// The stages that go row by row: those that were scheduled, or what they stand for.
    #[must_use]
    pub fn stages(&self) -> &[Stage] {
        &self.stages
    }

    /// The stages by their index, each with the rows of its level that it computes next, in order.
    pub fn parts(&self) -> impl Iterator<Item = (usize, Range<usize>)> {
        let last = self.lags.last().copied().unwrap_or(0);
        let steps = (self.heights[0] + last).div_ceil(self.band);
        let order = (0..steps).flat_map(|step| (0..self.stages.len()).map(move |i| (step, i)));
        order
            .map(|(step, i)| (i, self.front(step, i)..self.front(step + 1, i)))
            .filter(|part| !part.1.is_empty())
    }

    /// Rows that stage `i` has computed after this many steps.
    fn front(&self, steps: usize, i: usize) -> usize {
        let level = self.stages[i].level().unwrap_or(0);
        let rows = (steps * self.band).saturating_sub(self.lags[i]);
        if rows >= self.heights[0] { self.heights[level] } else { rows >> level }
    }
}

/// The stages that a stage stands for.
fn parts(stage: Stage) -> Vec<Stage> {
    match stage {
        Stage::Flood(z) => vec![Stage::Dependency(z), Stage::Belief(z)],
        _ => vec![stage],
    }
}

/// How many rows around its own, of its level, a stage reads; `None` where it does not go row by row. (Resolution goes by
/// rows of the coarser level, and reads and writes those of their children.)
fn reach(stage: Stage) -> Option<usize> {
    match stage {
        Stage::Dependency(_) | Stage::Belief(_) => Some(GRAPH_WINDOW / 2),
        Stage::SubPixel => Some(1),
        Stage::Evidence(_) | Stage::Resolution(_) | Stage::WinnerTakesAll | Stage::RightView => Some(0),
        _ => None,
    }
}

/// Whether `stage` needs volumes of level 0 that are not there where not all of its rows are held. (Costs alone are computed
/// where they are needed.)
#[must_use]
pub fn needs_level_0(stage: Stage) -> bool {
    match stage {
        Stage::Evidence(z) | Stage::Dependency(z) | Stage::Belief(z) | Stage::Flood(z) => z == 0,
        Stage::Resolution(z) => z == 1,
        Stage::Change | Stage::WinnerTakesAll | Stage::RightView => true,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{DisparityRange, Method};

    fn stages() -> Vec<Stage> {
        use Stage::{Belief, Dependency, Evidence, Resolution, RightView, SubPixel, WinnerTakesAll};
        let flood = |z| [Dependency(z), Belief(z)];
        let mut stages = vec![Evidence(0), Resolution(1), Belief(0), Belief(1)];
        stages.extend([flood(0), flood(1), flood(2)].concat());
        stages.extend([Resolution(2), Resolution(1)]);
        stages.extend([flood(0), flood(0)].concat());
        stages.extend([WinnerTakesAll, RightView, SubPixel]);
        stages
    }

    /// Rows of level 0 that a row of a stage stands for, and those that it reads.
    fn seen(stage: Stage, row: usize, height: usize) -> [Range<usize>; 2] {
        let z = stage.level().unwrap_or(0);
        let reach = reach(stage).unwrap();
        let rows = |first: usize, end: usize| (first << z).min(height)..(end << z).min(height);
        [rows(row, row + 1), rows(row.saturating_sub(reach), row + 1 + reach)]
    }

    /// Goes through the parts of a wavefront; the first rule that they break, if any.
    fn broken(wavefront: &Wavefront) -> Option<String> {
        let (stages, height) = (wavefront.stages(), wavefront.heights[0]);
        // Rows of level 0 that each stage has computed, from the top.
        let mut done = vec![0; stages.len()];
        for (i, rows) in wavefront.parts() {
            for row in rows {
                let [own, around] = seen(stages[i], row, height);
                if own.start != done[i] {
                    return Some(format!("{:?} skips to row {}", stages[i], own.start));
                }
                for j in 0..stages.len() {
                    if j < i && done[j] < around.end {
                        return Some(format!("{:?} reads what {:?} has not computed", stages[i], stages[j]));
                    }
                    if j > i && done[j] > around.start {
                        return Some(format!("{:?} overwrites what {:?} reads", stages[j], stages[i]));
                    }
                }
                done[i] = own.end;
                let first = done.iter().min().unwrap().saturating_sub(wavefront.above);
                if done[0] - first.min(done[0]) > wavefront.rows() {
                    return Some(format!("{} rows are held", done[0] - first));
                }
            }
        }
        done.iter().any(|&rows| rows != height).then(|| "not all rows are computed".into())
    }

    #[test]
    fn stages_find_what_they_read_and_spoil_nothing() {
        for height in [1, 2, 7, 16, 61, 300, 401] {
            let range = DisparityRange::new(0, 63).unwrap();
            let plan = Plan::new(40, height, range, &Method::default()).unwrap();
            let stages =
                || stages().into_iter().filter(|s| s.level().unwrap_or(0) < plan.levels.len()).collect();
            let wavefront = Wavefront::new(&plan, stages()).unwrap();
            assert_eq!(broken(&wavefront), None, "height {height}");
            assert!(wavefront.rows() <= height);
            if height > 200 {
                for i in (1..wavefront.lags.len()).filter(|&i| wavefront.lags[i] > wavefront.lags[i - 1]) {
                    let mut nearer = wavefront.clone();
                    nearer.lags[i..].iter_mut().for_each(|lag| *lag -= 4);
                    assert!(broken(&nearer).is_some(), "stage {i} four rows nearer must be noticed");
                }
            }
        }
    }

    /// Whether a ring of so many parts keeps each part until nobody needs it any more: a part is there from its upper halo on.
    fn fits_ring(wavefront: &Wavefront, part: usize, count: usize) -> bool {
        let (stages, height) = (wavefront.stages(), wavefront.heights[0]);
        let mut there = vec![0; count];
        wavefront.parts().all(|(i, rows)| {
            rows.into_iter().all(|row| {
                let [own, _] = seen(stages[i], row, height);
                if i == 0 {
                    let newest = (own.end - 1 + GRAPH_WINDOW / 2).min(height - 1) / part;
                    there[newest % count] = newest;
                }
                own.clone().all(|row| there[row / part % count] == row / part)
            })
        })
    }

    #[test]
    fn rings_keep_what_is_needed() {
        for height in [61, 300, 401] {
            let range = DisparityRange::new(0, 63).unwrap();
            let plan = Plan::new(40, height, range, &Method::default()).unwrap();
            let wavefront = Wavefront::new(&plan, stages()).unwrap();
            let plan = Plan { held: wavefront.rows(), ..plan };
            for part in [2, 8, 32] {
                let count = plan.ring_parts(part);
                assert!(fits_ring(&wavefront, part, count), "{count} parts of {part} rows, height {height}");
                let fewer = count * 2 / 3;
                assert!(height < 300 || !fits_ring(&wavefront, part, fewer), "{fewer} parts of {part} rows");
            }
        }
    }

    #[test]
    fn stages_that_look_at_the_whole_image_are_declined() {
        let plan = Plan::new(40, 40, DisparityRange::new(0, 9).unwrap(), &Method::default()).unwrap();
        assert!(Wavefront::new(&plan, vec![Stage::Evidence(0), Stage::LeftRightCheck]).is_none());
    }
}
