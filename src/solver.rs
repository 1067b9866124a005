//! The only place that knows levels, iterations, convergence and the order of what follows.

use crate::backend::{Backend, Map, Stage};
use crate::error::{Error, Result};
use crate::graph;
use crate::image::Pair;
use crate::maps::Maps;
use crate::options::{Fill, Median, Method, Visibility};
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
    /// What the stages stood between, and its time: the graph, handing it and the pair over, fetching the maps.
    pub around: [(&'static str, Duration); 3],
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

/// Matches `pair` by `plan` on `backend`.
///
/// # Errors
/// Whatever the backend reports, [`Error::Mismatch`] when the plan is for another size, and [`Error::Interrupted`]
/// when `observer` breaks.
pub fn solve(backend: &mut dyn Backend, plan: &Plan, pair: &Pair, observer: Observer) -> Result<Solution> {
    if plan.size() != pair.size() {
        return Err(Error::Mismatch(format!("a plan for {:?} and a pair of {:?}", plan.size(), pair.size())));
    }
    let second = plan.method.visibility == Visibility::SecondMatch;
    let matchings = if second { 2.0 } else { 1.0 };
    let mut work = Work { observer, done: 0.0, total: matchings * total_work(plan) };
    let mut around = [("graph", Duration::ZERO), ("upload", Duration::ZERO), ("download", Duration::ZERO)];
    let right_labels = if second {
        // The right view becomes the left one, its matches to the left again, when both are mirrored.
        let mirrored = pair.mirrored();
        estimate(backend, plan, &mirrored, &mut work, &mut around)?;
        Some(backend.read_map(Map::Label)?.mirrored())
    } else {
        None
    };
    let iterations = estimate(backend, plan, pair, &mut work, &mut around)?;
    if let Some(labels) = right_labels {
        backend.write_map(Map::RightLabel, &labels)?;
    }
    for stage in finish(&plan.method) {
        work.run(backend, plan, stage)?;
    }
    work.begin("maps", 0.0)?;
    backend.wait()?;
    let clock = Instant::now();
    let maps = backend.maps()?;
    around[2].1 += clock.elapsed();
    Ok(Solution { maps, iterations, around })
}

/// From the pair to the optimum of every pixel; the number of iterations.
fn estimate(
    backend: &mut dyn Backend,
    plan: &Plan,
    pair: &Pair,
    work: &mut Work,
    around: &mut [(&'static str, Duration); 3],
) -> Result<u32> {
    work.begin("graph", 0.0)?;
    let clock = Instant::now();
    let graphs = graph::build(pair.left(), plan);
    around[0].1 += clock.elapsed();
    let clock = Instant::now();
    backend.prepare(plan, pair, graphs)?;
    around[1].1 += clock.elapsed();
    let levels = 0..plan.levels.len();
    let pyramid = levels.clone().skip(1).map(Stage::Pyramid);
    for stage in iter::once(Stage::Cost).chain(pyramid).chain(levels.map(Stage::Evidence)) {
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
        &mut Work { observer: &mut |_| ControlFlow::Continue(()), done: 0.0, total: 1.0 },
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
    if method.fill != Fill::None {
        stages.push(Stage::Fill);
    }
    if method.median != Median::Off {
        stages.push(Stage::Median);
    }
    stages
}

/// Progress in cells (pixels times labels) of dependency messages, which take nearly all the time.
struct Work<'a> {
    observer: Observer<'a>,
    done: f64,
    total: f64,
}

impl Work<'_> {
    fn run(&mut self, backend: &mut dyn Backend, plan: &Plan, stage: Stage) -> Result<()> {
        let cells = match stage {
            Stage::Cost => cells(plan, 0),
            Stage::Pyramid(z) | Stage::Dependency(z) => cells(plan, z),
            _ => 0.0,
        };
        self.begin(stage.name(), cells)?;
        backend.run(stage)
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
