//! Wavefronts: several stages move down the image together, so that only the rows of level 0 between the
//! first and the last stage are held.
//!
//! In each step every stage, in the order of the schedule, computes its next [`BAND`] rows. It stays so far
//! behind the previous stage that its inputs are complete, and that it overwrites nothing that is still
//! needed. The results are the same as stage by stage.

use super::schedule::{self, split};
use super::{RowBand, Run, Sent, SentMessages, Step};
use crate::plan::Plan;
use crate::stage::{Data, Stage, Volume};
use std::ops::Range;

/// Rows of level 0 that each stage computes in a step, enough to share among threads.
pub(crate) const BAND: usize = 32;

/// The plan of a match without an inspector: if possible, the steps on level 0 run as a wavefront, and only
/// the rows between them are held.
#[must_use]
pub fn streamed(plan: &Plan) -> Plan {
    going_together(plan, &schedule::looks(plan)).map_or_else(|| plan.clone(), |(plan, ..)| plan)
}

/// The steps of a frame, with those on level 0 as a wavefront for each look, if possible; `plan` then holds fewer rows.
#[must_use]
pub(crate) fn pass(plan: &mut Plan, steps: Vec<Step>) -> Vec<Step> {
    let Some((streamed, wavefronts)) = going_together(plan, &steps) else { return steps };
    let mut all = Vec::new();
    let mut done = 0;
    for (range, wavefront) in wavefronts {
        all.extend_from_slice(&steps[done..range.start]);
        let sent = sent(plan, &steps[..range.start], &wavefront.stages);
        all.extend(wavefront.bands().map(|(i, rows)| {
            let band = Some(RowBand { rows, sent: sent[i] });
            Step::Run(Run { stage: wavefront.stages[i], levels: 1, band })
        }));
        let markers = steps[range.clone()].iter().filter(|step| step.stage().is_none());
        all.extend(markers.cloned());
        done = range.end;
    }
    all.extend_from_slice(&steps[done..]);
    *plan = streamed;
    all
}

/// The steps that a wavefront takes the place of, and the wavefront.
type Placed = (Range<usize>, Wavefront);

/// The plan with fewer rows, and the wavefront of each look; `None` if impossible or without savings.
fn going_together(plan: &Plan, steps: &[Step]) -> Option<(Plan, Vec<Placed>)> {
    let by_rows = |step: &Step| step.stage().map_or(*step == Step::Iteration, goes_by_rows);
    let mut ranges: Vec<Range<usize>> = Vec::new();
    for (start, step) in steps.iter().enumerate() {
        if step.stage() == Some(Stage::Evidence(0)) {
            ranges.push(start..start + steps[start..].iter().take_while(|step| by_rows(step)).count());
        }
    }
    // No other step may need level 0, and its costs are computed where they are needed.
    let cost = Data::Volume(Volume::Cost(0));
    let needs_whole = |stage: Stage| {
        stage.needs_level_0(plan) || (stage != Stage::Cost && stage.writes().any(|data| data == cost))
    };
    let mut outside =
        steps.iter().enumerate().filter(|(at, _)| !ranges.iter().any(|range| range.contains(at)));
    // If all levels join at once, the lags of their many iterations would cover all rows.
    let prevents = |step: &Step| step.stage().is_some_and(needs_whole);
    if plan.phases.len() == 1 || !plan.costs_go_by_rows() || outside.any(|(_, step)| prevents(step)) {
        return None;
    }
    let wavefront = |range: Range<usize>| {
        (range.clone(), Wavefront::new(plan, steps[range].iter().filter_map(Step::stage)))
    };
    let wavefronts: Vec<_> = ranges.into_iter().map(wavefront).collect();
    let held = wavefronts.iter().map(|(_, wavefront)| wavefront.rows()).max()?;
    let streamed = Plan { held, ..plan.clone() };
    // With few labels, costs are smaller than the data that they are computed from.
    (streamed.bytes() < plan.bytes()).then_some((streamed, wavefronts))
}

/// Whether `stage`, or each of its parts, can run on a band of rows.
fn goes_by_rows(stage: Stage) -> bool {
    split(stage.into()).iter().all(|run| run.stage.descriptor().reach.is_some())
}

/// The messages that exist when each of `stages` starts, after the steps `before`.
fn sent(plan: &Plan, before: &[Step], stages: &[Stage]) -> Vec<Sent> {
    let mut messages = SentMessages::none(plan.levels.len());
    before.iter().filter_map(Step::stage).for_each(|stage| messages.send(stage));
    let each = stages.iter().map(|&stage| {
        let sent = messages.at(stage);
        messages.send(stage);
        sent
    });
    each.collect()
}

/// Stages that move down the image together.
#[derive(Clone, Debug)]
struct Wavefront {
    stages: Vec<Stage>,
    /// Rows of level 0 by which each stage is behind the first.
    lags: Vec<usize>,
    /// Height of each level.
    heights: Vec<usize>,
    /// Rows of level 0 per step.
    band: usize,
    /// Rows of level 0 above its own that the last stage reads.
    above: usize,
}

/// Number of rows around its own that a stage reads at its level, if it can run on a band.
fn reach(stage: Stage) -> usize {
    stage.descriptor().reach.expect("a stage that goes row by row")
}

impl Wavefront {
    /// The wavefront of these stages, which can run on bands of rows.
    fn new(plan: &Plan, stages: impl Iterator<Item = Stage>) -> Self {
        let stages: Vec<Stage> = stages.flat_map(|stage| split(stage.into())).map(|run| run.stage).collect();
        let level = |stage: &Stage| stage.level().unwrap_or(0);
        // Multiples of a pixel of the coarsest level are whole rows at all levels.
        let step = 1 << stages.iter().map(level).max().unwrap_or(0);
        let reaches: Vec<usize> = stages.iter().map(|stage| reach(*stage) << level(stage)).collect();
        let mut behind = 0;
        let mut lags = Vec::new();
        for (i, &own) in reaches.iter().enumerate() {
            // The stage before may still read what this one overwrites.
            let before = if i == 0 { 0 } else { own.max(reaches[i - 1]) };
            behind += before.next_multiple_of(step);
            lags.push(behind);
        }
        let heights = plan.levels.iter().map(|level| level.height).collect();
        let above = reaches.last().copied().unwrap_or(0);
        Self { stages, lags, heights, band: BAND.next_multiple_of(step), above }
    }

    /// Largest number of rows of level 0 needed at the same time.
    fn rows(&self) -> usize {
        (self.band + self.lags.last().unwrap_or(&0) + self.above).min(self.heights[0])
    }

    /// In order, the index of a stage and the rows of its level that it computes next.
    fn bands(&self) -> impl Iterator<Item = (usize, Range<usize>)> {
        let last = self.lags.last().copied().unwrap_or(0);
        let steps = (self.heights[0] + last).div_ceil(self.band);
        let order = (0..steps).flat_map(|step| (0..self.stages.len()).map(move |i| (step, i)));
        order
            .map(|(step, i)| (i, self.front(step, i)..self.front(step + 1, i)))
            .filter(|band| !band.1.is_empty())
    }

    /// Rows that stage `i` has computed after `steps` steps.
    fn front(&self, steps: usize, i: usize) -> usize {
        let level = self.stages[i].level().unwrap_or(0);
        let rows = (steps * self.band).saturating_sub(self.lags[i]);
        if rows >= self.heights[0] { self.heights[level] } else { rows >> level }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{DisparityRange, Method};
    use crate::plan::GRAPH_WINDOW;

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

    /// Rows of level 0 that a row of a stage covers, and those that it reads.
    fn seen(stage: Stage, row: usize, height: usize) -> [Range<usize>; 2] {
        let z = stage.level().unwrap_or(0);
        let reach = reach(stage);
        let rows = |first: usize, end: usize| (first << z).min(height)..(end << z).min(height);
        [rows(row, row + 1), rows(row.saturating_sub(reach), row + 1 + reach)]
    }

    /// Checks the order of a wavefront; returns the first broken rule.
    fn broken(wavefront: &Wavefront) -> Option<String> {
        let (stages, height) = (&wavefront.stages[..], wavefront.heights[0]);
        // Rows of level 0 that each stage has computed, from the top.
        let mut done = vec![0; stages.len()];
        for (i, rows) in wavefront.bands() {
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
    fn stages_read_complete_rows_and_overwrite_no_needed_ones() {
        for height in [1, 2, 7, 16, 61, 300, 401] {
            let range = DisparityRange::new(0, 63).unwrap();
            let plan = Plan::new(40, height, range, &Method::default()).unwrap();
            let there = |stage: &Stage| stage.level().unwrap_or(0) < plan.levels.len();
            let wavefront = Wavefront::new(&plan, stages().into_iter().filter(there));
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

    /// Whether a ring of `count` parts keeps each part, upper halo included, as long as it is needed.
    fn fits_ring(wavefront: &Wavefront, part: usize, count: usize) -> bool {
        let (stages, height) = (&wavefront.stages[..], wavefront.heights[0]);
        let mut there = vec![0; count];
        wavefront.bands().all(|(i, rows)| {
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
    fn rings_keep_all_needed_parts() {
        for height in [61, 300, 401] {
            let range = DisparityRange::new(0, 63).unwrap();
            let plan = Plan::new(40, height, range, &Method::default()).unwrap();
            let wavefront = Wavefront::new(&plan, stages().into_iter());
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
    fn stages_on_the_whole_image_prevent_a_wavefront() {
        let plan = Plan::new(40, 400, DisparityRange::new(0, 63).unwrap(), &Method::default()).unwrap();
        let (mut held, steps) = (plan.clone(), schedule::estimate(&plan));
        assert!(pass(&mut held, steps.clone()).len() > steps.len() && held.held < plan.held);
        let change = Step::of(Stage::Change);
        for at in 0..=steps.len() {
            let steps = [&steps[..at], std::slice::from_ref(&change), &steps[at..]].concat();
            assert_eq!(pass(&mut plan.clone(), steps.clone()), steps, "at {at}");
        }
    }

    /// Every row of every stage runs once, with the messages that existed when the stage started.
    #[test]
    fn bands_cover_every_stage() {
        let plan = Plan::new(40, 400, DisparityRange::new(0, 63).unwrap(), &Method::default()).unwrap();
        let steps = schedule::estimate(&plan);
        let bands = pass(&mut plan.clone(), steps.clone());
        let rows = |steps: &[Step]| {
            let mut rows = std::collections::BTreeMap::new();
            for step in steps {
                let Step::Run(run) = step else { continue };
                for run in split(run.clone()) {
                    let height = plan.levels[run.stage.level().unwrap_or(0)].height;
                    let count = run.band.as_ref().map_or(height, |band| band.rows.len());
                    *rows.entry(run.stage).or_insert(0) += count;
                }
            }
            rows
        };
        assert_eq!(rows(&bands), rows(&steps));
        let sent = |stage: Stage, first: bool| {
            let mut bands = bands.iter().filter_map(|step| match step {
                Step::Run(Run { stage: s, band: Some(band), .. }) if *s == stage => Some(band.sent),
                _ => None,
            });
            if first { bands.next().unwrap() } else { bands.next_back().unwrap() }
        };
        assert!(!sent(Stage::Dependency(0), true).dependency);
        assert!(sent(Stage::Belief(1), true).dependency && sent(Stage::Belief(1), true).below);
    }
}
