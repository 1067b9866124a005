//! The only place that knows levels, iterations, convergence and the order of what follows.

use crate::backend::{Backend, Map, Stage};
use crate::error::{Error, Result};
use crate::front::illumination::homomorphic;
use crate::front::matches::{self, Match};
use crate::front::support;
use crate::front::zones::{self, Zones};
use crate::graph::{self, LevelGraph};
use crate::image::{Pair, Plane};
use crate::maps::Maps;
use crate::options::{Fill, Illumination, Median, Method, Visibility};
use crate::plan::Plan;
use std::iter;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// What a match leaves behind.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The maps.
    pub maps: Maps,
    /// Iterations done, of all phases together.
    pub iterations: u32,
    /// What the host did around the stages, and how long it took.
    pub around: Vec<(&'static str, Duration)>,
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
    Supports(&'a [Plane<[u16; 2]>]),
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
    if plan.size() != pair.size() {
        return Err(Error::Mismatch(format!("a plan for {:?} and a pair of {:?}", plan.size(), pair.size())));
    }
    let second = plan.method.visibility == Visibility::SecondMatch;
    let matchings = if second { 2.0 } else { 1.0 };
    let mut work =
        Work { observer, inspector, done: 0.0, total: matchings * total_work(plan), around: Vec::new() };
    let right_labels = if second {
        // The right view becomes the left one, its matches to the left again, when both are mirrored.
        let mirrored = pair.mirrored();
        let inspector = work.inspector.take();
        estimate(backend, plan, &mirrored, &mut work)?;
        work.inspector = inspector;
        Some(backend.read_map(Map::Label)?.mirrored())
    } else {
        None
    };
    let iterations = estimate(backend, plan, pair, &mut work)?;
    if let Some(labels) = right_labels {
        backend.write_map(Map::RightLabel, &labels)?;
    }
    for stage in finish(&plan.method) {
        work.run(backend, plan, stage)?;
    }
    backend.wait()?;
    let maps = work.host("download", || backend.maps())?;
    Ok(Solution { maps, iterations, around: work.around })
}

/// From the pair to the optimum of every pixel; the number of iterations.
fn estimate(backend: &mut dyn Backend, plan: &Plan, pair: &Pair, work: &mut Work) -> Result<u32> {
    let method = &plan.method;
    let corrected = match method.illumination {
        Illumination::None => None,
        Illumination::Homomorphic => {
            let both = || Pair::new(homomorphic(pair.left()), homomorphic(pair.right()));
            let corrected = work.host("illumination", both)?;
            work.look(&mut Glimpse::Corrected(&corrected))?;
            Some(corrected)
        }
    };
    let pair = corrected.as_ref().unwrap_or(pair);
    let graphs = work.host("graph", || Ok(graph::build(pair.left(), plan)))?;
    work.look(&mut Glimpse::Graphs(&graphs))?;
    work.host("upload", || backend.prepare(plan, pair, graphs))?;
    if plan.restricted() {
        let options = zones::Options { zones: method.zones as usize, ..zones::Options::default() };
        let zones = work.host("zones", || Ok(zones::segment(pair.left(), &options)))?;
        let split = Some((&zones.map, zones.count));
        let matches = work.host("matches", || Ok(matches::find(pair, split, Some(plan.range))))?;
        work.look(&mut Glimpse::Matches(pair, &zones, &matches))?;
        let supports = work.host("support", || Ok(support::levels(plan, &zones, &matches)))?;
        work.look(&mut Glimpse::Supports(&supports))?;
        work.host("upload", || backend.restrict(&supports))?;
    }
    let levels = 0..plan.levels.len();
    let costs = levels.clone().flat_map(|z| {
        let cost = if z == 0 { Stage::Cost } else { Stage::Pyramid(z) };
        iter::once(cost).chain(plan.restricted().then_some(Stage::Restrict(z)))
    });
    for stage in costs.chain(levels.clone().map(Stage::Evidence)) {
        work.run(backend, plan, stage)?;
    }
    let iterations = propagate(backend, plan, work)?;
    work.run(backend, plan, Stage::Estimate)?;
    Ok(iterations)
}

/// Runs the flooding of `plan` on the evidence that `backend` holds; returns the number of iterations.
///
/// # Errors
/// Whatever the backend reports.
pub fn flood(backend: &mut dyn Backend, plan: &Plan) -> Result<u32> {
    propagate(
        backend,
        plan,
        &mut Work {
            observer: &mut |_| ControlFlow::Continue(()),
            inspector: None,
            done: 0.0,
            total: 1.0,
            around: Vec::new(),
        },
    )
}

fn propagate(backend: &mut dyn Backend, plan: &Plan, work: &mut Work) -> Result<u32> {
    let coarsest = plan.levels.len() - 1;
    let tolerance = plan.method.tolerance;
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
        for _ in 0..phase.iterations {
            iterations += 1;
            let levels = phase.finest..=coarsest;
            let stages = levels
                .clone()
                .map(Stage::Dependency)
                .chain(levels.clone().skip(1).map(Stage::Resolution))
                .chain(levels.map(Stage::Belief));
            for stage in stages {
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

/// What follows the estimate.
fn finish(method: &Method) -> Vec<Stage> {
    let mut stages = Vec::new();
    if method.visibility == Visibility::RightView {
        stages.push(Stage::RightView);
    }
    stages.extend([Stage::SubPixel, Stage::Visibility]);
    if method.region_size > 1 {
        stages.push(Stage::RegionFilter);
    }
    stages.push(Stage::Confidence);
    match method.fill {
        Fill::None => {}
        Fill::Row => stages.push(Stage::Fill),
        Fill::Median => stages.extend([Stage::Fill, Stage::FillMedian]),
    }
    if method.median != Median::Off {
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
    /// Time of what the host does.
    around: Vec<(&'static str, Duration)>,
}

impl Work<'_, '_> {
    fn run(&mut self, backend: &mut dyn Backend, plan: &Plan, stage: Stage) -> Result<()> {
        let cells = match stage {
            Stage::Cost => cells(plan, 0),
            Stage::Pyramid(z) | Stage::Dependency(z) => cells(plan, z),
            _ => 0.0,
        };
        self.begin(stage.name(), cells)?;
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
        let progress = Progress { stage, done: (self.done / self.total).min(1.0) };
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

fn total_work(plan: &Plan) -> f64 {
    let all: f64 = (0..plan.levels.len()).map(|z| cells(plan, z)).sum();
    let iterations: f64 = plan
        .phases
        .iter()
        .map(|p| f64::from(p.iterations) * (p.finest..plan.levels.len()).map(|z| cells(plan, z)).sum::<f64>())
        .sum();
    all + iterations
}
