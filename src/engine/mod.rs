//! Runs the steps of a match on a backend, with progress, cancelling, inspection and timing.

mod double_size;
mod gathering;
mod mosaic;
mod running;
mod source;

use crate::backend::{Backend, Stage, Traffic};
use crate::error::Result;
use crate::front::conditioning::Conditioning;
use crate::front::{self, Prepared};
use crate::image::Pair;
use crate::maps::Maps;
use crate::plan::Plan;
use crate::prior::PriorUse;
use crate::program::{Frame, Program, Step, View};
use crate::watch::{Followed, Observer, Progress, Watch};
use gathering::Gathering;
use mosaic::Mosaic;
use running::Running;
use source::Source;
use std::ops::ControlFlow;
use std::time::Duration;

/// The result of a match.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The maps.
    pub maps: Maps,
    /// Iterations done, of all phases together; the most of any tile.
    pub iterations: u32,
    /// The corrections that were made to the pair.
    pub conditioning: Conditioning,
    /// How much of the prior was used; `None` without one.
    pub prior: Option<PriorUse>,
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
    let mut started = MatchRun { overlaps: true, ..MatchRun::new(backend, program, false) };
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
    /// Whether other matches use the backend meanwhile, so that this one does not wait for it between stages.
    overlaps: bool,
    source: Source,
    running: Running,
    gathering: Gathering,
}

impl MatchRun {
    fn new(backend: &mut dyn Backend, program: &Program, inspected: bool) -> Self {
        // An inspected match runs the unfused program, so that the inspector sees complete levels.
        let program = if inspected { program.clone() } else { backend.fit(program.clone()) };
        let followed = Followed::new(program.work());
        let (source, running, gathering) = Default::default();
        Self { program, next: 0, followed, overlaps: false, source, running, gathering }
    }

    fn solution(self) -> Solution {
        let Self { followed, source, running, gathering, .. } = self;
        Solution {
            maps: gathering.maps.expect("a list that collects maps"),
            iterations: running.earlier_iterations + running.most_iterations,
            conditioning: source.conditioning,
            prior: source.used(),
            host_times: followed.times,
            mosaic_times: gathering.times,
            traffic: running.traffic,
            cells: running.cells,
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
            let looks_in = !self.source.is_double && !self.frame().mirrored;
            let inspector =
                inspector.as_mut().filter(|_| looks_in).map(|inspector| &mut **inspector as Inspector);
            self.step(step, backend, original, &mut watch, inspector).await?;
        }
        if until.is_some() {
            // The next match may use the backend before this one is completed.
            self.count(backend);
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
        let Self { program, source, running, gathering, .. } = self;
        let plan = &program.frames[running.frame].plan;
        match step {
            Step::Condition => source.condition(original, plan, watch)?,
            Step::Correct(known) => {
                // An inspector may read the half on any thread.
                let halves = backend.halves_pairs() && !looks_in;
                source.correct(original, plan, known, halves, watch)?;
            }
            Step::Know(prior) => source.know(&prior, plan, watch)?,
            Step::Double => {
                source.double(original, watch)?;
                gathering.put_aside();
                running.end_round();
            }
            Step::Enter(frame) => {
                self.count(backend);
                let prepared = self.enter(frame, backend, watch)?;
                if !self.frame().mirrored {
                    inspect(&mut Inspection::Prepared(&prepared))?;
                }
                watch.host("upload", || backend.prepare(self.plan(), prepared))?;
            }
            Step::Run(run) => {
                watch.begin(run.stage.name(), run.work(plan))?;
                let target = gathering.target(backend);
                target.perform(&run)?;
                // A browser's thread has other tasks.
                if !self.overlaps || cfg!(target_arch = "wasm32") {
                    target.keep_up().await?;
                }
                inspect(&mut Inspection::Stage(target, run.stage))?;
            }
            Step::Free(data) => gathering.target(backend).free(data),
            Step::Iteration => {
                running.iterations += 1;
                inspect(&mut Inspection::Iteration(backend, running.iterations))?;
            }
            // With an inspector, wait for convergence, so that no idle iteration is reported.
            Step::Settled => {
                if backend.settled(looks_in).await? {
                    let rest = &program.steps[self.next..];
                    self.next += rest.iter().position(|step| *step == Step::EndOfPhase).unwrap_or(0);
                }
            }
            Step::EndOfPhase => {}
            Step::Mosaic(frame) => {
                gathering.whole = frame;
                gathering.mosaic =
                    Some(Mosaic::new(&program.frames[frame].plan, source.pair(), source.anchors())?);
            }
            Step::Place(view) => {
                if view == View::Left {
                    running.settle(backend.idle_iterations().await?);
                }
                backend.wait().await?;
                let placed = gathering.place(&program.frames[running.frame], view, source.part(), backend);
                watch.host_async("download", placed).await?;
            }
            Step::Gather => {
                self.count(backend);
                watch.followed.tile = None;
                self.gathering.gather()?;
            }
            Step::LookAgain => {
                let guess = gathering.look_again(&program.frames[gathering.whole].plan).await?;
                source.guess(guess);
                running.end_round();
            }
            Step::PlaceRight => gathering.place_right()?,
            Step::Ask(view) => gathering.ask(view, backend)?,
            Step::Collect => {
                let size = program.frames[gathering.whole].plan.of_pair().size;
                if let Some(idle) = gathering.collect(size, backend, watch).await? {
                    running.settle(idle);
                }
                self.count(backend);
            }
            Step::Join => gathering.join(watch),
        }
        Ok(())
    }

    /// Enters `frame`, and returns its prepared pair.
    fn enter(&mut self, frame: usize, backend: &mut dyn Backend, watch: &mut Watch<'_>) -> Result<Prepared> {
        let Self { program, source, running, gathering, .. } = self;
        running.enter(frame);
        let entered = &program.frames[frame];
        if entered.tile.is_none() {
            gathering.whole = frame;
        }
        watch.followed.tile = entered.tile;
        let pair = source.enter(entered)?;
        backend.release();
        let mut prepared = front::prepare(pair, &entered.plan, watch)?;
        prepared.prior = source.prior_of(entered);
        source.part = gathering.mosaic.is_some().then(|| prepared.pair.clone());
        Ok(prepared)
    }

    fn frame(&self) -> &Frame {
        &self.program.frames[self.running.frame]
    }

    fn plan(&self) -> &Plan {
        &self.frame().plan
    }

    /// Counts the backend's work for the frame that was entered last.
    fn count(&mut self, backend: &dyn Backend) {
        let own_size = !self.source.is_double && !self.frame().mirrored;
        self.running.count(backend, own_size);
    }
}
