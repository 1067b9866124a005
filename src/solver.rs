//! The only place that knows levels, iterations, convergence and the order of what follows.

use crate::backend::{Backend, Estimate};
use crate::error::{Error, Result};
use crate::graph;
use crate::image::{Pair, Plane};
use crate::options::{Fill, Median};
use crate::plan::Plan;
use crate::refine::{self, FRACTION, MedianWeights, flag};
use std::ops::ControlFlow;

/// What a match leaves behind; all maps have the size of the images.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Solution {
    /// The final disparity in 1/256 px; meaningless where [`Solution::has_disparity`] says no.
    pub disparity: Plane<i32>,
    /// The disparity before post-processing, in 1/256 px, of every pixel that is not masked.
    pub raw: Plane<i32>,
    /// Confidence 0 ..= 255.
    pub confidence: Plane<u8>,
    /// Bits of [`refine::flag`].
    pub validity: Plane<u8>,
    /// Iterations done, of all phases together.
    pub iterations: u32,
}

impl Solution {
    /// Whether a pixel with these validity bits has a disparity in the final map.
    #[must_use]
    pub fn has_disparity(validity: u8) -> bool {
        validity & flag::INVALID == 0 || validity & flag::FILLED != 0
    }

    /// The final map in pixels, `+inf` where there is none.
    #[must_use]
    pub fn final_map(&self) -> Plane<f32> {
        pixels(&self.disparity, &self.validity, Self::has_disparity)
    }

    /// The map before post-processing in pixels, `+inf` on masked pixels.
    #[must_use]
    pub fn raw_map(&self) -> Plane<f32> {
        pixels(&self.raw, &self.validity, |f| f & flag::MASKED == 0)
    }
}

fn pixels(fixed: &Plane<i32>, validity: &Plane<u8>, known: impl Fn(u8) -> bool) -> Plane<f32> {
    let (width, height) = fixed.size();
    Plane::from_fn(width, height, |x, y| {
        if known(validity[(x, y)]) { fixed[(x, y)] as f32 / FRACTION as f32 } else { f32::INFINITY }
    })
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
    let mut work = Work { observer, done: 0.0, total: total_work(plan) };
    work.begin("graph", 0.0)?;
    backend.prepare(plan, pair, graph::build(pair.left(), plan))?;
    work.begin("cost", cells(plan, 0))?;
    backend.cost()?;
    for level in 1..plan.levels.len() {
        work.begin("pyramid", cells(plan, level))?;
        backend.pyramid(level)?;
    }
    for level in 0..plan.levels.len() {
        work.begin("evidence", 0.0)?;
        backend.evidence(level)?;
    }
    let iterations = propagate(backend, plan, &mut work)?;
    work.begin("estimate", 0.0)?;
    let estimate = backend.estimate()?;
    work.begin("refine", 0.0)?;
    Ok(refine_estimate(&estimate, plan, pair, iterations))
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
            backend.resolution(phase.finest + 1)?;
            backend.belief(phase.finest)?;
            backend.belief(phase.finest + 1)?;
        }
        let converges = tolerance > 0.0 && phase.finest == 0;
        if converges {
            backend.change()?;
        }
        for _ in 0..phase.iterations {
            iterations += 1;
            for level in phase.finest..=coarsest {
                work.begin("dependency", cells(plan, level))?;
                backend.dependency(level)?;
            }
            for level in phase.finest + 1..=coarsest {
                backend.resolution(level)?;
            }
            for level in phase.finest..=coarsest {
                backend.belief(level)?;
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

fn refine_estimate(estimate: &Estimate, plan: &Plan, pair: &Pair, iterations: u32) -> Solution {
    let method = &plan.method;
    let min = plan.range.min;
    let guide = pair.left();
    let (width, height) = plan.size();
    let labels = estimate.peaks.map(|peak| (min + i32::from(peak.label)) * FRACTION);
    let raw = if method.sub_pixel {
        Plane::from_fn(width, height, |x, y| labels[(x, y)] + i32::from(estimate.offsets[(x, y)]))
    } else {
        labels.clone()
    };
    let mut validity =
        if method.visibility { refine::visibility(estimate, min) } else { Plane::filled(width, height, 0) };
    for (flags, &masked) in validity.data_mut().iter_mut().zip(guide.masked.data()) {
        if masked {
            *flags = flag::MASKED;
        }
    }
    refine::region_filter(&labels, &mut validity, method.region_size as usize);
    let confidence = refine::confidence(&estimate.peaks, &mut validity, method.confidence_floor);
    let mut disparity = raw.clone();
    if method.fill == Fill::Row {
        refine::fill(&mut disparity, &mut validity);
    }
    if method.median != Median::Off {
        let weights = MedianWeights::new(
            method.median_window as usize,
            method.median_sigma_space,
            method.median_sigma_range,
        );
        let all = method.median == Median::All;
        disparity =
            refine::weighted_median(&disparity, &validity, guide, &weights, |f| all || f & flag::FILLED != 0);
    }
    Solution { disparity, raw, confidence, validity, iterations }
}

/// Progress in cells (pixels times labels) of dependency messages, which take nearly all the time.
struct Work<'a> {
    observer: Observer<'a>,
    done: f64,
    total: f64,
}

impl Work<'_> {
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
