//! From pairs to their maps: opens what runs the stages, checks it, and falls back where that is allowed.

use crate::backend::cpu::Cpu;
use crate::backend::gpu::{self, Gpu};
use crate::backend::{Backend, Stage, Traffic};
use crate::engine::{self, Solution, Started};
use crate::error::{BudgetError, DeviceError, Error, ExecutionError, Result};
use crate::image::{Image, Pair, Plane};
use crate::maps::Maps;
use crate::options::{DeviceChoice, DisparityRange, Execution, Method};
use crate::plan::Plan;
use crate::solver::Inspector;
use crate::tiles::Tiles;
use crate::watch::Observer;
use std::ops::ControlFlow;
use std::time::Duration;

/// The maps of a pair, and what made them.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Matched {
    /// The maps.
    pub maps: Maps,
    /// Iterations done, of all phases together; the most of any tile.
    pub iterations: u32,
    /// The plan that was followed, for the whole image.
    pub plan: Plan,
    /// How the image was cut for it: one tile where it was not.
    pub tiles: Tiles,
    /// What ran the stages, for people.
    pub ran_on: String,
    /// The driver of the device that did, as far as it says; `None` for the CPU path.
    pub driver: Option<String>,
    /// Why it is not the device that was hoped for, where that is so.
    pub note: Option<String>,
    /// The time of every stage, in the order of their first run; empty unless [`Execution::timings`] asks.
    pub timings: Vec<Timing>,
    /// What went through the device.
    pub traffic: Traffic,
}

/// The time that a stage took, over all its runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timing {
    /// The stage, or what the host does around the stages: "illumination", "graph", "upload", "zones" and the like.
    pub stage: &'static str,
    /// Its level, where it has one.
    pub level: Option<usize>,
    /// How often it ran.
    pub runs: u32,
    /// All runs together, by the device's own clock where it has one.
    pub time: Duration,
}

/// Matches pair after pair, and keeps in between what is dear: the device, its compiled shaders, its buffers.
pub struct Matcher {
    pool: rayon::ThreadPool,
    cpu: Cpu,
    gpu: Option<Gpu>,
    /// The last method that the device was seen to compute as the CPU path does.
    checked: Option<Method>,
    /// Whether the CPU path may step in.
    falls_back: bool,
    /// Why there is no device any more.
    given_up: Option<String>,
    timings: bool,
}

impl Matcher {
    /// Opens what `execution` names.
    ///
    /// # Errors
    /// [`Error::Execution`] for what makes no sense and for a device that is not there, [`Error::Device`] where there is no
    /// driver or the device cannot be opened.
    pub fn new(execution: &Execution) -> Result<Self> {
        match &execution.device {
            DeviceChoice::Cpu => Self::build(None, false, execution),
            DeviceChoice::Gpu => Self::build(Some(Gpu::new(None)), false, execution),
            DeviceChoice::Named(name) => Self::build(Some(Gpu::new(Some(name))), false, execution),
            DeviceChoice::Auto => Self::build(gpu::has_automatic().then(|| Gpu::new(None)), true, execution),
        }
    }

    /// On `gpu`; where that fails or cannot serve, on the CPU path if it `falls_back`.
    ///
    /// # Errors
    /// [`Error::Execution`] for a number of threads that cannot be had, and the error of `gpu` unless it falls back.
    pub fn on(gpu: Result<Gpu>, falls_back: bool, execution: &Execution) -> Result<Self> {
        Self::build(Some(gpu), falls_back, execution)
    }

    fn build(gpu: Option<Result<Gpu>>, falls_back: bool, execution: &Execution) -> Result<Self> {
        let mut pool = rayon::ThreadPoolBuilder::new();
        if let Some(threads) = execution.threads {
            if threads == 0 {
                return Err(ExecutionError::NoThreads.into());
            }
            pool = pool.num_threads(threads);
        }
        let pool = pool.build().map_err(|e| ExecutionError::Threads(e.to_string()))?;
        let (gpu, given_up) = match gpu.transpose() {
            Ok(gpu) => (gpu, None),
            Err(e @ (Error::Device(_) | Error::Memory(_))) if falls_back => (None, Some(e.to_string())),
            Err(e) => return Err(e),
        };
        Ok(Self {
            pool,
            cpu: Cpu::default(),
            gpu,
            checked: None,
            falls_back,
            given_up,
            timings: execution.timings,
        })
    }

    /// From now on takes the time of every stage, or does not, whatever [`Execution::timings`] said.
    pub fn keep_time(&mut self, on: bool) {
        self.timings = on;
    }

    /// Matches `pair` over `range` by `method`; `observer` hears of progress and can stop it.
    ///
    /// # Errors
    /// [`Error::Option`] for options out of range, [`Error::Budget`] where no tile is small enough for the method's memory,
    /// [`Error::Device`] where the wanted device fails, [`Error::Memory`] when the machine or the device cannot hold it,
    /// [`Error::Interrupted`] when `observer` breaks.
    pub fn run(
        &mut self,
        pair: &Pair,
        range: DisparityRange,
        method: &Method,
        observer: Observer,
    ) -> Result<Matched> {
        self.inspect(pair, range, method, observer, None)
    }

    /// As [`Matcher::run`], and `inspector` looks into the match on its way.
    ///
    /// # Errors
    /// Those of [`Matcher::run`] and of `inspector`.
    pub fn inspect(
        &mut self,
        pair: &Pair,
        range: DisparityRange,
        method: &Method,
        observer: Observer,
        mut inspector: Option<Inspector>,
    ) -> Result<Matched> {
        let (width, height) = pair.size();
        let plan = Plan::new(width, height, range, method)?;
        let tiles = Tiles::new(&plan)?;
        if inspector.is_some() && tiles.count() > 1 {
            let (tiles, needed) = (tiles.count(), plan.bytes().div_ceil(1 << 20));
            return Err(BudgetError::StepsOfTiles { tiles, needed }.into());
        }
        let Self { pool, gpu, checked, timings, .. } = self;
        let mut note = None;
        if let Some(device) = gpu {
            let served = pool.install(|| {
                check(device, &plan.method, checked)?;
                timed(device, *timings, &tiles, pair, &mut *observer, again(&mut inspector))
            });
            match served {
                Err(e) => note = Some(self.without_device(e)?),
                served => return served,
            }
        }
        let Self { pool, cpu, given_up, timings, .. } = self;
        let note = note.or_else(|| given_up.clone());
        let matched = pool.install(|| timed(cpu, *timings, &tiles, pair, observer, inspector))?;
        Ok(Matched { note, ..matched })
    }

    /// Matches pair after pair, each over its range, and hands the results to `take`, in order, until it breaks. While a
    /// device is at one pair, the next one's graphs are built and go up, and the maps of the one before come down. (Not with
    /// [`Execution::timings`], nor where a pair is cut into tiles.)
    ///
    /// # Errors
    /// Those of [`Matcher::run`]; the results of all pairs before have been handed out then.
    pub fn run_all(
        &mut self,
        pairs: impl IntoIterator<Item = (Pair, DisparityRange)>,
        method: &Method,
        observer: Observer,
        take: &mut dyn FnMut(Matched) -> ControlFlow<()>,
    ) -> Result<()> {
        let mut last: Option<Flight> = None;
        for (pair, range) in pairs {
            let started = self.start(&pair, range, method, &mut *observer);
            if let Some(last) = last.take()
                && take(self.land(last, method, &mut *observer)?).is_break()
            {
                return Ok(());
            }
            match started? {
                Some((tiles, started)) => last = Some(Flight { pair, range, tiles, started }),
                None => {
                    if take(self.run(&pair, range, method, &mut *observer)?).is_break() {
                        return Ok(());
                    }
                }
            }
        }
        if let Some(last) = last {
            let _ = take(self.land(last, method, observer)?);
        }
        Ok(())
    }

    /// Starts a match on the device, where it can be left to itself.
    fn start(
        &mut self,
        pair: &Pair,
        range: DisparityRange,
        method: &Method,
        observer: Observer,
    ) -> Result<Option<(Tiles, Started)>> {
        let Self { pool, gpu: Some(device), checked, timings: false, .. } = self else { return Ok(None) };
        let (width, height) = pair.size();
        let plan = Plan::new(width, height, range, method)?;
        let tiles = Tiles::new(&plan)?;
        if tiles.count() > 1 {
            return Ok(None);
        }
        let started = pool.install(|| {
            check(device, &plan.method, checked)?;
            device.keep_time(false)?;
            engine::start(device, &plan, pair, observer)
        });
        match started {
            Ok(started) => Ok(Some((tiles, started))),
            Err(e) => self.without_device(e).map(|_| None),
        }
    }

    /// Ends a match that was started on the device; where that has failed meanwhile, matches once more without it.
    fn land(&mut self, flight: Flight, method: &Method, observer: Observer) -> Result<Matched> {
        let Flight { pair, range, tiles, started } = flight;
        if let Some(device) = &mut self.gpu {
            match self.pool.install(|| engine::finish(device, started)) {
                Ok(solution) => return Ok(matched(device, &tiles, solution, Vec::new())),
                Err(e) => self.without_device(e)?,
            };
        }
        self.run(&pair, range, method, observer)
    }

    /// What to tell of a device that failed, where the CPU path may step in: the bits are the same there, so it costs time and
    /// nothing else.
    ///
    /// # Errors
    /// The failure, where it may not.
    fn without_device(&mut self, failure: Error) -> Result<String> {
        if !self.falls_back || !matches!(failure, Error::Device(_) | Error::Memory(_)) {
            return Err(failure);
        }
        let note = failure.to_string();
        // What is too large for it this time may fit the next.
        if matches!(failure, Error::Device(_)) {
            self.gpu = None;
            self.given_up = Some(note.clone());
        }
        Ok(note)
    }
}

/// A match that was started on a device.
struct Flight {
    pair: Pair,
    range: DisparityRange,
    tiles: Tiles,
    started: Started,
}

/// Matches `pair` over `range` by `method`, where `execution` says; `observer` hears of progress and can stop it.
///
/// # Errors
/// Those of [`Matcher::new`] and [`Matcher::run`].
pub fn match_pair(
    pair: &Pair,
    range: DisparityRange,
    method: &Method,
    execution: &Execution,
    observer: Observer,
) -> Result<Matched> {
    Matcher::new(execution)?.run(pair, range, method, observer)
}

fn timed(
    backend: &mut dyn Backend,
    timings: bool,
    tiles: &Tiles,
    pair: &Pair,
    observer: Observer,
    inspector: Option<Inspector>,
) -> Result<Matched> {
    backend.keep_time(timings)?;
    let solution = if tiles.count() == 1 {
        engine::inspect(backend, tiles.whole(), pair, observer, inspector)?
    } else {
        engine::solve_tiles(backend, tiles, pair, observer)?
    };
    let timings = if timings { summed(&solution, &backend.times()?) } else { Vec::new() };
    Ok(matched(backend, tiles, solution, timings))
}

fn matched(backend: &dyn Backend, tiles: &Tiles, solution: Solution, timings: Vec<Timing>) -> Matched {
    Matched {
        timings,
        traffic: solution.traffic,
        maps: solution.maps,
        iterations: solution.iterations,
        plan: tiles.whole().clone(),
        tiles: tiles.clone(),
        ran_on: backend.describe(),
        driver: backend.driver(),
        note: None,
    }
}

/// The same inspector once more, for a shorter time.
fn again<'a>(inspector: &'a mut Option<Inspector>) -> Option<Inspector<'a>> {
    match inspector {
        Some(inspector) => Some(&mut **inspector),
        None => None,
    }
}

/// One entry a stage and level.
fn summed(solution: &Solution, times: &[(Stage, Duration)]) -> Vec<Timing> {
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

/// Sees that a device computes a small pair by `method` as the CPU path does, before it is trusted with a large
/// one: a driver that gets arithmetic, loops or memory wrong says nothing.
fn check(gpu: &mut Gpu, method: &Method, checked: &mut Option<Method>) -> Result<()> {
    if checked.as_ref() == Some(method) {
        return Ok(());
    }
    let (width, height) = (48, 20);
    let texture = |x: usize, y: usize| {
        let hash = (x as u32 * 73 + y as u32 * 179 + 1).wrapping_mul(0x9e37_79b9);
        [hash >> 24, hash >> 16 & 0xff, hash >> 8 & 0xff].map(|v| v as u8)
    };
    // Two surfaces, the nearer below.
    let step = |y: usize| if y < height / 2 { 3 } else { 8 };
    let left = Image::from_rgb8(&Plane::from_fn(width, height, texture));
    let right = Image::from_rgb8(&Plane::from_fn(width, height, |x, y| texture(x + step(y), y)));
    let pair = Pair::new(left, right)?;
    let plan = Plan::new(width, height, DisparityRange::new(-1, 16)?, method)?;
    let quiet = &mut |_| ControlFlow::Continue(());
    let expected = engine::solve(&mut Cpu::default(), &plan, &pair, quiet)?;
    let found = engine::solve(gpu, &plan, &pair, quiet)?;
    if found.maps != expected.maps {
        return Err(DeviceError::WrongMaps { name: gpu.describe() }.into());
    }
    *checked = Some(method.clone());
    Ok(())
}
