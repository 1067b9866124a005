//! Runs the steps of a match on a backend, with progress, cancelling, inspection and timing.

mod double_size;
mod mosaic;

use crate::backend::cpu::Cpu;
use crate::backend::{Backend, Map, Stage, Ticket, Traffic};
use crate::error::{Purpose, Result};
use crate::front::conditioning::Conditioning;
use crate::front::{self, Prepared};
use crate::image::{Pair, Plane};
use crate::maps::{Maps, RightMap, flag};
use crate::memory;
use crate::plan::Plan;
use crate::program::{Frame, Program, Step, View};
use crate::watch::{Followed, Observer, Progress, Watch};
use mosaic::Mosaic;
use std::ops::ControlFlow;
use std::time::Duration;
use web_time::Instant;

/// The result of a match.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The maps.
    pub maps: Maps,
    /// Iterations done, of all phases together; the most of any tile.
    pub iterations: u32,
    /// The corrections that were made to the pair.
    pub conditioning: Conditioning,
    /// The host steps around the stages, each with its time.
    pub host_times: Vec<(&'static str, Duration)>,
    /// The time of every stage that ran on the merged maps of all tiles.
    pub mosaic_times: Vec<(Stage, Duration)>,
    /// Data that went through the device.
    pub traffic: Traffic,
    /// [`Backend::cells`] of each level at the pair's own size, summed over all tiles.
    pub cells: Vec<u64>,
}

/// An event of a running match, for an inspector.
pub enum Inspection<'a> {
    /// The prepared pair, with the data derived from it.
    Prepared(&'a Prepared),
    /// A stage has run.
    Stage(&'a mut dyn Backend, Stage),
    /// This many iterations are done.
    Iteration(&'a mut dyn Backend, u32),
}

/// Inspects a running match for diagnosis: it may read any volume and map, which takes time.
pub type Inspector<'a> = &'a mut (dyn FnMut(&mut Inspection) -> Result<()> + Send);

/// Matches `pair` by `program` on `backend`. `observer` receives progress, and `inspector`, if any, inspects
/// the match of the pair at its own size.
///
/// # Errors
/// The errors of the backend, [`crate::Error::Mismatch`] when the program is for another size,
/// [`crate::Error::Interrupted`] when `observer` breaks, and those of `inspector`.
pub async fn solve(
    backend: &mut dyn Backend,
    program: &Program,
    pair: &Pair,
    observer: Observer<'_>,
    inspector: Option<Inspector<'_>>,
) -> Result<Solution> {
    let mut started = MatchRun::new(backend, program, inspector.is_some());
    started.advance(backend, pair, observer, inspector, None).await?;
    Ok(started.solution())
}

/// Like [`solve`], but returns before the first step that waits for the device. If the [program waits
/// once](Program::waits_once), the next match may be started on the backend before [`finish`] completes this one.
///
/// # Errors
/// The errors of [`solve`].
pub async fn start(
    backend: &mut dyn Backend,
    program: &Program,
    pair: &Pair,
    observer: Observer<'_>,
) -> Result<MatchRun> {
    let mut started = MatchRun::new(backend, program, false);
    started.advance(backend, pair, observer, None, Some(Step::Collect)).await?;
    Ok(started)
}

/// Completes a match of `pair` that was started on `backend`.
///
/// # Errors
/// The errors of the backend.
pub async fn finish(backend: &mut dyn Backend, mut started: MatchRun, pair: &Pair) -> Result<Solution> {
    let quiet = &mut |_: Progress| ControlFlow::Continue(());
    started.advance(backend, pair, quiet, None, None).await?;
    Ok(started.solution())
}

/// A match that is running through its steps.
pub struct MatchRun {
    program: Program,
    /// The next step.
    next: usize,
    followed: Followed,
    /// The pair that is matched, and the part of it that the backend holds.
    pair: Option<Pair>,
    part: Option<Pair>,
    /// The frame that was entered last, and whether the backend's work for it has been counted.
    frame: usize,
    is_counted: bool,
    /// The frame of the whole image.
    whole: usize,
    /// Iterations of the frame, and the most of any at this size.
    iterations: u32,
    most_iterations: u32,
    /// Whether the pair is at twice its size.
    doubled: bool,
    mosaic: Option<Mosaic>,
    /// After all tiles: the CPU path for the stages on whole maps, and the disparities of the right view.
    gathered: Option<(Cpu, Plane<i32>)>,
    tickets: Vec<(View, Ticket)>,
    /// The maps that were found so far.
    found: Option<Maps>,
    solution: Partial,
}

/// The parts of a [`Solution`] that are complete.
#[derive(Default)]
struct Partial {
    /// The maps at the pair's own size, while it is matched at twice its size.
    own: Option<Maps>,
    iterations: u32,
    conditioning: Conditioning,
    mosaic_times: Vec<(Stage, Duration)>,
    traffic: Traffic,
    cells: Vec<u64>,
}

impl MatchRun {
    fn new(backend: &mut dyn Backend, program: &Program, inspected: bool) -> Self {
        // An inspected match runs the unfused program, so that the inspector sees complete levels.
        let program = if inspected { program.clone() } else { backend.fit(program.clone()) };
        let followed = Followed::new(program.work());
        Self {
            program,
            next: 0,
            followed,
            pair: None,
            part: None,
            frame: 0,
            is_counted: true,
            whole: 0,
            iterations: 0,
            most_iterations: 0,
            doubled: false,
            mosaic: None,
            gathered: None,
            tickets: Vec::new(),
            found: None,
            solution: Partial::default(),
        }
    }

    fn solution(self) -> Solution {
        let Partial { iterations, conditioning, mosaic_times, traffic, cells, .. } = self.solution;
        Solution {
            maps: self.found.expect("a list that collects maps"),
            iterations: iterations + self.most_iterations,
            conditioning,
            host_times: self.followed.times,
            mosaic_times,
            traffic,
            cells,
        }
    }

    /// Runs the steps up to the first `until`, or all.
    async fn advance(
        &mut self,
        backend: &mut dyn Backend,
        original: &Pair,
        observer: Observer<'_>,
        mut inspector: Option<Inspector<'_>>,
        until: Option<Step>,
    ) -> Result<()> {
        let mut watch = Watch::new(observer, std::mem::take(&mut self.followed));
        while let Some(step) = self.program.steps.get(self.next).cloned() {
            if until.as_ref() == Some(&step) {
                break;
            }
            self.next += 1;
            let looks_in = !self.doubled && !self.program.frames[self.frame].mirrored;
            let inspector =
                inspector.as_mut().filter(|_| looks_in).map(|inspector| &mut **inspector as Inspector);
            self.step(step, backend, original, &mut watch, inspector).await?;
        }
        if until.is_some() {
            // The next match may use the backend before this one is completed.
            self.leave(backend);
        }
        self.followed = watch.followed;
        Ok(())
    }

    async fn step(
        &mut self,
        step: Step,
        backend: &mut dyn Backend,
        original: &Pair,
        watch: &mut Watch<'_>,
        inspector: Option<Inspector<'_>>,
    ) -> Result<()> {
        let looks_in = inspector.is_some();
        let inspect = |inspection: &mut Inspection| match inspector {
            Some(inspector) => inspector(inspection),
            None => Ok(()),
        };
        match step {
            Step::Condition => {
                let (pair, conditioning) = front::condition(original, self.plan(), watch)?;
                (self.pair, self.solution.conditioning) = (Some(pair), conditioning);
            }
            Step::Correct(known) => {
                self.pair = Some(front::correct(original, self.plan(), &known, watch)?);
                self.solution.conditioning = known;
            }
            Step::Double => {
                let conditioning = &self.solution.conditioning;
                self.pair = Some(watch.host("double_size", || front::doubled(original, conditioning))?);
                (self.solution.own, self.doubled) = (self.found.take(), true);
                self.solution.iterations = std::mem::take(&mut self.most_iterations);
            }
            Step::Mosaic(frame) => {
                self.whole = frame;
                self.mosaic = Some(Mosaic::new(&self.program.frames[frame].plan, self.pair())?);
            }
            Step::Enter(frame) => {
                self.leave(backend);
                self.frame = frame;
                let frame = &self.program.frames[frame];
                if frame.tile.is_none() {
                    self.whole = self.frame;
                }
                watch.followed.tile = frame.tile;
                let pair = part(self.pair(), frame)?;
                backend.release();
                let prepared = front::prepare(pair, &frame.plan, watch)?;
                self.part = self.mosaic.is_some().then(|| prepared.pair.clone());
                if !frame.mirrored {
                    inspect(&mut Inspection::Prepared(&prepared))?;
                }
                watch.host("upload", || backend.prepare(&frame.plan, prepared))?;
                (self.is_counted, self.iterations) = (false, 0);
            }
            Step::Run(run) => {
                watch.begin(run.stage.name(), run.work(self.plan()))?;
                let target = self.target(backend);
                target.perform(&run)?;
                target.keep_up().await?;
                inspect(&mut Inspection::Stage(target, run.stage))?;
            }
            Step::Free(data) => self.target(backend).free(data),
            Step::Iteration => {
                self.iterations += 1;
                inspect(&mut Inspection::Iteration(backend, self.iterations))?;
            }
            // With an inspector, wait for convergence, so that no idle iteration is reported.
            Step::Settled => {
                if backend.settled(looks_in).await? {
                    let rest = &self.program.steps[self.next..];
                    self.next += rest.iter().position(|step| *step == Step::EndOfPhase).unwrap_or(0);
                }
            }
            Step::EndOfPhase => {}
            Step::Place(view) => {
                if view == View::Left {
                    let idle = backend.idle_iterations().await?;
                    self.most_iterations = self.most_iterations.max(self.iterations - idle);
                }
                backend.wait().await?;
                let mosaic = self.mosaic.as_mut().expect("maps to place them in");
                let pair = self.part.as_ref().expect("a frame was entered");
                let placed = mosaic.place(&self.program.frames[self.frame], view, pair, backend);
                watch.host_async("download", placed).await?;
            }
            Step::Gather => {
                self.leave(backend);
                watch.followed.tile = None;
                let (mut cpu, right) = self.mosaic.take().expect("maps to gather").gathered();
                cpu.keep_time(true)?;
                self.gathered = Some((cpu, right));
            }
            Step::PlaceRight => {
                let (cpu, right) = self.gathered.as_mut().expect("maps of all tiles");
                let raw = std::mem::replace(right, Plane::filled(0, 0, 0)).mirrored();
                for map in [Map::Raw, Map::Disparity] {
                    cpu.probe().write_map(map, &raw)?;
                }
            }
            Step::Ask(view) => {
                let ticket = self.target(backend).request_maps()?;
                self.tickets.push((view, ticket));
            }
            Step::Collect => {
                let tickets = std::mem::take(&mut self.tickets);
                let target = self.target(backend);
                target.wait().await?;
                let (maps, idle) = watch.host_async("download", collect(target, tickets)).await?;
                self.found = Some(maps.cut_to(self.program.frames[self.whole].plan.of_pair().size));
                if let Some((mut cpu, _)) = self.gathered.take() {
                    self.solution.mosaic_times.extend(cpu.times().await?);
                } else {
                    self.most_iterations = self.iterations - idle;
                }
                self.leave(backend);
            }
            Step::Join => {
                let clock = Instant::now();
                let double = self.found.take().expect("the maps at twice the size");
                let mut own = self.solution.own.take().expect("the maps at the pair's own size");
                double_size::take_in(&mut own, &double);
                self.found = Some(own);
                watch.followed.times.push(("double_size", clock.elapsed()));
            }
        }
        Ok(())
    }

    fn plan(&self) -> &Plan {
        &self.program.frames[self.frame].plan
    }

    fn pair(&self) -> &Pair {
        self.pair.as_ref().expect("the pair was conditioned")
    }

    /// The backend that runs the next stages.
    fn target<'a>(&'a mut self, backend: &'a mut dyn Backend) -> &'a mut dyn Backend {
        match &mut self.gathered {
            Some((cpu, _)) => cpu,
            None => backend,
        }
    }

    /// Counts the backend's work for the frame that was entered last.
    fn leave(&mut self, backend: &dyn Backend) {
        if std::mem::replace(&mut self.is_counted, true) {
            return;
        }
        let solution = &mut self.solution;
        solution.traffic += backend.traffic();
        if !self.doubled && !self.program.frames[self.frame].mirrored {
            let cells = backend.cells();
            solution.cells.resize(cells.len(), 0);
            solution.cells.iter_mut().zip(cells).for_each(|(sum, more)| *sum += more);
        }
    }
}

/// The part of `pair` that belongs to `frame`, if the memory holds a copy.
fn part(pair: &Pair, frame: &Frame) -> Result<Pair> {
    let copy = |make: &dyn Fn() -> Pair| {
        memory::check(frame.plan.pair_bytes(), Purpose::Match)?;
        Ok(make())
    };
    let crop = if frame.tile.is_none() { pair.clone() } else { copy(&|| pair.crop(&frame.crop))? };
    if frame.mirrored { copy(&|| crop.mirrored()) } else { Ok(crop) }
}

/// The requested maps, and the number of idle iterations.
async fn collect(backend: &mut dyn Backend, tickets: Vec<(View, Ticket)>) -> Result<(Maps, u32)> {
    let mut all: Option<(Maps, u32)> = None;
    for (_, ticket) in tickets {
        let (maps, idle) = backend.maps(ticket).await?;
        match &mut all {
            Some((left, _)) => left.right = Some(right_map(maps)),
            None => all = Some((maps, idle)),
        }
    }
    Ok(all.expect("the left view was asked for"))
}

/// The map of the right view, from the maps of the mirrored pair.
fn right_map(maps: Maps) -> RightMap {
    RightMap {
        disparity: maps.disparity.mirrored(),
        // The runner-up of a right pixel is unknown.
        validity: maps.validity.mirrored().map(|validity| validity & !flag::LOW_CONFIDENCE),
    }
}
