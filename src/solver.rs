//! The only place that knows levels, iterations, convergence and the order of what follows.

use crate::backend::cpu::Mosaic;
use crate::backend::{Backend, Map, Requested, Stage, Traffic};
use crate::error::{Error, Result};
use crate::front::illumination::homomorphic;
use crate::front::label_range;
use crate::front::matches::{self, Match};
use crate::front::zones::{self, Zones};
use crate::graph::{self, LevelGraph};
use crate::image::{Pair, Plane};
use crate::maps::Maps;
use crate::memory;
use crate::options::{Fill, Illumination, LeftRightCheck, Median, Method, Order};
use crate::plan::{Phase, Plan};
use crate::tiles::Tiles;
use std::iter;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// What a match leaves behind.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The maps.
    pub maps: Maps,
    /// Iterations done, of all phases together; the most of any tile.
    pub iterations: u32,
    /// What the host did around the stages, and how long it took.
    pub around: Vec<(&'static str, Duration)>,
    /// The time of every stage that ran on the maps of all tiles.
    pub finish: Vec<(Stage, Duration)>,
    /// What went through the device.
    pub traffic: Traffic,
}

/// Told how far a match is; answers whether to go on.
pub type Observer<'a> = &'a mut (dyn FnMut(Progress) -> ControlFlow<()> + Send);

/// How far a match is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// The stage about to run.
    pub stage: &'static str,
    /// Share of the work that is done, 0 to 1.
    pub done: f64,
    /// The tile at hand, from 1 on, and how many there are: twice those of the image where it is matched twice.
    pub tile: Option<(usize, usize)>,
}

/// What an inspector sees of a match on its way.
pub enum Glimpse<'a> {
    /// The pair, its illumination corrected.
    Corrected(&'a Pair),
    /// The graphs of all levels.
    Graphs(&'a [LevelGraph]),
    /// The pair as it is matched, its texture zones and its sparse matches.
    Matches(&'a Pair, &'a Zones, &'a [Match]),
    /// First and last label of each pixel, by level.
    LabelRanges(&'a [Plane<[u16; 2]>]),
    /// A stage has run.
    Stage(&'a mut dyn Backend, Stage),
    /// This many iterations are done.
    Iteration(&'a mut dyn Backend, u32),
}

/// Looks into a match on its way, for diagnosis: it may read any volume and map, at the price of time.
pub type Inspector<'a> = &'a mut (dyn FnMut(&mut Glimpse) -> Result<()> + Send);

/// Matches `pair` by `plan` on `backend`; `observer` hears of progress.
///
/// # Errors
/// Whatever the backend reports, [`Error::Mismatch`] when the plan is for another size, and [`Error::Interrupted`]
/// when `observer` breaks.
pub fn solve(backend: &mut dyn Backend, plan: &Plan, pair: &Pair, observer: Observer) -> Result<Solution> {
    inspect(backend, plan, pair, observer, None)
}

/// As [`solve`], and `inspector`, if any, looks into the match on its way.
///
/// # Errors
/// Those of [`solve`] and of `inspector`.
pub fn inspect(
    backend: &mut dyn Backend,
    plan: &Plan,
    pair: &Pair,
    observer: Observer,
    inspector: Option<Inspector>,
) -> Result<Solution> {
    let mut work = Work::new(observer, inspector, matchings(plan) as f64 * total_work(plan));
    let iterations = run(backend, plan, pair, &mut work)?;
    backend.wait()?;
    let maps = work.host("download", || backend.request_maps().and_then(|maps| backend.maps(maps)))?;
    let traffic = backend.traffic();
    Ok(Solution { maps, iterations, around: work.around, finish: Vec::new(), traffic })
}

/// A match whose stages may still run, or whose maps are on their way.
pub struct Started {
    requested: Requested,
    iterations: u32,
    around: Vec<(&'static str, Duration)>,
    traffic: Traffic,
}

/// As [`solve`], but does not wait for a device: the next match may be started on it before [`finish`] ends this one.
///
/// # Errors
/// Those of [`solve`].
pub fn start(backend: &mut dyn Backend, plan: &Plan, pair: &Pair, observer: Observer) -> Result<Started> {
    let mut work = Work::new(observer, None, matchings(plan) as f64 * total_work(plan));
    let iterations = run(backend, plan, pair, &mut work)?;
    let requested = backend.request_maps()?;
    Ok(Started { requested, iterations, around: work.around, traffic: backend.traffic() })
}

/// Ends a match that was started on `backend`.
///
/// # Errors
/// Whatever the backend reports.
pub fn finish(backend: &mut dyn Backend, started: Started) -> Result<Solution> {
    let Started { requested, iterations, around, traffic } = started;
    Ok(Solution { maps: backend.maps(requested)?, iterations, around, finish: Vec::new(), traffic })
}

/// All stages of a match in one piece; the number of iterations.
fn run(backend: &mut dyn Backend, plan: &Plan, pair: &Pair, work: &mut Work) -> Result<u32> {
    check_size(plan, pair)?;
    memory::check(plan.front_bytes(), memory::SMALLER_MATCH)?;
    let right_labels = if matchings(plan) == 2 {
        // The right view becomes the left one, its matches to the left again, when both are mirrored.
        let inspector = work.inspector.take();
        let mirrored = corrected(plan, pair.mirrored(), work)?;
        estimate(backend, plan, &mirrored, work)?;
        work.inspector = inspector;
        Some(backend.read_map(Map::Label)?.mirrored())
    } else {
        None
    };
    let pair = corrected(plan, pair.clone(), work)?;
    let iterations = estimate(backend, plan, &pair, work)?;
    if let Some(labels) = right_labels {
        backend.write_map(Map::RightLabel, &labels)?;
    }
    for stage in read_out(&plan.method).into_iter().chain(post_processing(&plan.method)) {
        work.run(backend, plan, stage)?;
    }
    Ok(iterations)
}

/// Matches `pair` tile by tile on `backend`, and finishes the maps of all tiles together on the CPU path; `observer` hears
/// of progress.
///
/// # Errors
/// Those of [`solve`].
pub fn solve_tiles(
    backend: &mut dyn Backend,
    tiles: &Tiles,
    pair: &Pair,
    observer: Observer,
) -> Result<Solution> {
    let whole = tiles.whole();
    check_size(whole, pair)?;
    memory::check(tiles.largest().front_bytes(), memory::SMALLER_MATCH)?;
    let all: f64 = tiles.list().iter().map(|tile| total_work(&tile.plan)).sum();
    let mut work = Work::new(observer, None, matchings(whole) as f64 * all);
    work.tile = Some((0, matchings(whole) * tiles.count()));
    let mut mosaic = Mosaic::new(whole, pair)?;
    let (mut iterations, mut traffic) = (0, Traffic::default());
    if matchings(whole) == 2 {
        for tile in tiles.list() {
            work.next_tile();
            let mirrored = pair.crop(&tile.crop.mirrored(pair.size().0)).mirrored();
            let mirrored = corrected(whole, mirrored, &mut work)?;
            estimate(backend, &tile.plan, &mirrored, &mut work)?;
            backend.wait()?;
            work.host("download", || mosaic.place_mirrored(tile, backend))?;
            traffic += backend.traffic();
        }
    }
    for tile in tiles.list() {
        work.next_tile();
        let pair = corrected(whole, pair.crop(&tile.crop), &mut work)?;
        iterations = iterations.max(estimate(backend, &tile.plan, &pair, &mut work)?);
        for stage in read_out(&whole.method) {
            work.run(backend, &tile.plan, stage)?;
        }
        backend.wait()?;
        work.host("download", || mosaic.place(tile, &pair, backend))?;
        traffic += backend.traffic();
    }
    work.tile = None;
    let mut times = Vec::new();
    for stage in post_processing(&whole.method) {
        work.begin(stage.name(), 0.0)?;
        let clock = Instant::now();
        mosaic.run(stage);
        times.push((stage, clock.elapsed()));
    }
    Ok(Solution { maps: mosaic.into_maps(), iterations, around: work.around, finish: times, traffic })
}

fn check_size(plan: &Plan, pair: &Pair) -> Result<()> {
    if plan.size() == pair.size() {
        return Ok(());
    }
    Err(Error::Mismatch(format!("a plan for {:?} and a pair of {:?}", plan.size(), pair.size())))
}

/// How often a pair is matched: once more, mirrored, where that is how its right view is found.
fn matchings(plan: &Plan) -> usize {
    if plan.method.refinement.left_right_check == LeftRightCheck::SecondMatch { 2 } else { 1 }
}

/// The pair with its illumination corrected, where that is asked for.
fn corrected(plan: &Plan, pair: Pair, work: &mut Work) -> Result<Pair> {
    match plan.method.front.illumination {
        Illumination::None => Ok(pair),
        Illumination::Homomorphic => {
            let both = || Pair::new(homomorphic(pair.left()), homomorphic(pair.right()));
            let corrected = work.host("illumination", both)?;
            work.look(&mut Glimpse::Corrected(&corrected))?;
            Ok(corrected)
        }
    }
}

/// From the corrected pair to the optimum of every pixel; the number of iterations.
fn estimate(backend: &mut dyn Backend, plan: &Plan, pair: &Pair, work: &mut Work) -> Result<u32> {
    let method = &plan.method;
    let graphs = work.host("graph", || Ok(graph::build(pair.left(), plan)))?;
    work.look(&mut Glimpse::Graphs(&graphs))?;
    work.host("upload", || backend.prepare(plan, pair, graphs))?;
    if plan.limits_labels() {
        let options = zones::Options { zones: method.front.zones as usize, ..zones::Options::default() };
        let zones = work.host("zones", || Ok(zones::segment(pair.left(), &options)))?;
        let split = Some((&zones.map, zones.count));
        let matches = work.host("matches", || Ok(matches::find(pair, split, Some(plan.range))))?;
        work.look(&mut Glimpse::Matches(pair, &zones, &matches))?;
        let label_ranges = work.host("zone-sigmas", || Ok(label_range::levels(plan, &zones, &matches)))?;
        work.look(&mut Glimpse::LabelRanges(&label_ranges))?;
        work.host("upload", || backend.label_range(&label_ranges))?;
    }
    let levels = 0..plan.levels.len();
    let costs = levels.clone().flat_map(|z| {
        let cost = if z == 0 { Stage::Cost } else { Stage::Pyramid(z) };
        iter::once(cost).chain(plan.limits_labels().then_some(Stage::LabelRange(z)))
    });
    for stage in costs.chain(levels.clone().map(Stage::Evidence)) {
        work.run(backend, plan, stage)?;
    }
    let iterations = propagate(backend, plan, work)?;
    work.run(backend, plan, Stage::WinnerTakesAll)?;
    Ok(iterations)
}

/// Runs the flooding of `plan` on the evidence that `backend` holds; returns the number of iterations.
///
/// # Errors
/// Whatever the backend reports.
pub fn flood(backend: &mut dyn Backend, plan: &Plan) -> Result<u32> {
    propagate(backend, plan, &mut Work::new(&mut |_| ControlFlow::Continue(()), None, 1.0))
}

fn propagate(backend: &mut dyn Backend, plan: &Plan, work: &mut Work) -> Result<u32> {
    let coarsest = plan.levels.len() - 1;
    let tolerance = plan.method.schedule.tolerance;
    let mut iterations = 0;
    for phase in &plan.phases {
        if phase.finest < coarsest && plan.phases.len() > 1 {
            // What the coarser levels know reaches the new one before its own messages start. The coarser level's
            // beliefs take in what came up, or the next resolution would take off a message that they do not hold.
            let (joining, above) = (phase.finest, phase.finest + 1);
            for stage in [Stage::Resolution(above), Stage::Belief(joining), Stage::Belief(above)] {
                work.run(backend, plan, stage)?;
            }
        }
        let converges = tolerance > 0.0 && phase.finest == 0;
        if converges {
            backend.change()?;
        }
        for i in 0..phase.iterations {
            iterations += 1;
            for stage in iteration(plan, phase, i) {
                work.run(backend, plan, stage)?;
            }
            work.look(&mut Glimpse::Iteration(backend, iterations))?;
            if converges {
                let (sum, pixels) = (backend.change()? as f64, plan.levels[0].pixels() as f64);
                if sum <= tolerance * tolerance * pixels {
                    break;
                }
            }
        }
    }
    Ok(iterations)
}

/// The stages of iteration `i`, from 0 on, of a phase. Every message is from old beliefs: those between levels first, then a
/// level's own and its new beliefs.
fn iteration(plan: &Plan, phase: &Phase, i: u32) -> impl Iterator<Item = Stage> + use<> {
    let (finest, coarsest) = (phase.finest, plan.levels.len() - 1);
    // The coarsest levels that are resolved and that are flooded.
    let (resolved, flooded) = match plan.method.schedule.order {
        Order::Together => (coarsest, coarsest),
        // What joining has just resolved would give the same messages again.
        Order::CoarseFirst if finest > 0 => (if i == 0 { finest } else { coarsest }, coarsest),
        // The coarser levels have settled: they and level 0 speak in turns. A level that is farther away than messages
        // between levels still go has no say any more.
        Order::CoarseFirst => {
            let reach = coarsest.min((phase.iterations / 2 - i / 2) as usize);
            if i.is_multiple_of(2) { (0, reach) } else { (reach, 0) }
        }
    };
    (finest + 1..=resolved).map(Stage::Resolution).chain((finest..=flooded).map(Stage::Flood))
}

/// What follows the estimate and looks at volumes still.
fn read_out(method: &Method) -> Vec<Stage> {
    let right = (method.refinement.left_right_check == LeftRightCheck::RightView).then_some(Stage::RightView);
    right.into_iter().chain([Stage::SubPixel]).collect()
}

/// What follows that, and looks at maps alone.
fn post_processing(method: &Method) -> Vec<Stage> {
    let mut stages = vec![Stage::LeftRightCheck];
    if method.refinement.speckle_size > 1 {
        stages.push(Stage::SpeckleFilter);
    }
    stages.push(Stage::Confidence);
    match method.refinement.fill {
        Fill::None => {}
        Fill::Row => stages.push(Stage::Fill),
        Fill::Median => stages.extend([Stage::Fill, Stage::FillMedian]),
    }
    if method.refinement.median != Median::Off {
        stages.push(Stage::Median);
    }
    stages
}

/// Progress in cells (pixels times labels) of dependency messages, which take nearly all the time.
struct Work<'a, 'b> {
    observer: Observer<'a>,
    inspector: Option<Inspector<'b>>,
    done: f64,
    total: f64,
    /// The tile at hand, and how many there are.
    tile: Option<(usize, usize)>,
    /// Time of what the host does.
    around: Vec<(&'static str, Duration)>,
}

impl<'a, 'b> Work<'a, 'b> {
    fn new(observer: Observer<'a>, inspector: Option<Inspector<'b>>, total: f64) -> Self {
        Self { observer, inspector, done: 0.0, total, tile: None, around: Vec::new() }
    }

    fn next_tile(&mut self) {
        self.tile = self.tile.map(|(tile, all)| (tile + 1, all));
    }

    fn run(&mut self, backend: &mut dyn Backend, plan: &Plan, stage: Stage) -> Result<()> {
        self.begin(stage.name(), work_of(plan, stage))?;
        backend.run(stage)?;
        self.look(&mut Glimpse::Stage(backend, stage))
    }

    /// Does what the host does, and takes the time.
    fn host<T>(&mut self, name: &'static str, job: impl FnOnce() -> Result<T>) -> Result<T> {
        self.begin(name, 0.0)?;
        let clock = Instant::now();
        let done = job()?;
        self.around.push((name, clock.elapsed()));
        Ok(done)
    }

    fn look(&mut self, glimpse: &mut Glimpse) -> Result<()> {
        self.inspector.as_mut().map_or(Ok(()), |inspector| inspector(glimpse))
    }

    fn begin(&mut self, stage: &'static str, cells: f64) -> Result<()> {
        let progress = Progress { stage, done: (self.done / self.total).min(1.0), tile: self.tile };
        self.done += cells;
        match (self.observer)(progress) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Error::Interrupted),
        }
    }
}

fn cells(plan: &Plan, level: usize) -> f64 {
    (plan.levels[level].pixels() * plan.levels[level].stride) as f64
}

fn work_of(plan: &Plan, stage: Stage) -> f64 {
    match stage {
        Stage::Cost => cells(plan, 0),
        Stage::Pyramid(z) | Stage::Flood(z) => cells(plan, z),
        _ => 0.0,
    }
}

fn total_work(plan: &Plan) -> f64 {
    let all: f64 = (0..plan.levels.len()).map(|z| cells(plan, z)).sum();
    let iterations = plan.phases.iter().flat_map(|phase| (0..phase.iterations).map(move |i| (phase, i)));
    let stages = iterations.flat_map(|(phase, i)| iteration(plan, phase, i));
    all + stages.map(|stage| work_of(plan, stage)).sum::<f64>()
}
