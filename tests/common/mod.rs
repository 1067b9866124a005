//! Shared parts of the test binaries: a naive twin of every stage, the backends under test, seeded random
//! input, and a comparison that reports where two volumes differ.

#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a test that cannot go on panics")]
#![allow(clippy::needless_range_loop, reason = "twins read like the formulas that they are written from")]

pub mod compare;
pub mod devices;
pub mod random;
pub mod twin;

use mrfgs::image::{Image, Pair};
use mrfgs::low_level::backend::Backend;
use mrfgs::low_level::engine::{self, Inspector, Solution};
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::graph::{self, LevelGraph};
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::program::tiles::Tiles;
use mrfgs::low_level::program::{Program, Step, schedule};
use mrfgs::low_level::watch::Observer;
use pollster::block_on;

/// The graphs of all levels of `plan`, chosen by `image`.
pub fn graphs(image: &Image, plan: &Plan) -> Vec<LevelGraph> {
    let mut guide = image.clone();
    let mut graphs = vec![graph::of_level(&guide, plan)];
    for _ in 1..plan.levels.len() {
        guide = guide.downsampled();
        graphs.push(graph::of_level(&guide, plan));
    }
    graphs
}

/// Prepares `backend` for a match of `pair` by `plan`, with `graphs`.
pub fn prepare(backend: &mut dyn Backend, plan: &Plan, pair: &Pair, graphs: &[LevelGraph]) {
    backend.prepare(plan, Prepared::new(pair)).unwrap();
    for (z, graph) in graphs.iter().enumerate() {
        backend.probe().set_graph(z, graph).unwrap();
    }
}

/// Runs the message passing of `plan` on the evidence in `backend`; returns the number of iterations.
pub fn flood(backend: &mut dyn Backend, plan: &Plan) -> mrfgs::Result<u32> {
    run(backend, &schedule::flood(plan, 0, |_, _| Vec::new()))
}

/// Like [`flood`], from the costs in `backend`.
pub fn flood_on_costs(backend: &mut dyn Backend, plan: &Plan) -> mrfgs::Result<u32> {
    run(backend, &schedule::flood(plan, 0, |plan, z| schedule::join(plan, 0, z)))
}

/// Runs steps of message passing; returns the number of iterations.
fn run(backend: &mut dyn Backend, steps: &[Step]) -> mrfgs::Result<u32> {
    let (mut iterations, mut steps) = (0, steps.iter());
    while let Some(step) = steps.next() {
        match step {
            Step::Run(run) => {
                backend.perform(run)?;
                block_on(backend.keep_up())?;
            }
            Step::Iteration => iterations += 1,
            Step::Settled if block_on(backend.settled(false))? => {
                steps.find(|step| **step == Step::EndOfPhase);
            }
            _ => {}
        }
    }
    Ok(iterations)
}

/// Matches `pair` by `plan` in one piece, regardless of memory.
pub fn solve(
    backend: &mut dyn Backend,
    plan: &Plan,
    pair: &Pair,
    observer: Observer<'_>,
) -> mrfgs::Result<Solution> {
    inspect(backend, plan, pair, observer, None)
}

/// Like [`solve`], with an `inspector`.
pub fn inspect(
    backend: &mut dyn Backend,
    plan: &Plan,
    pair: &Pair,
    observer: Observer<'_>,
    inspector: Option<Inspector<'_>>,
) -> mrfgs::Result<Solution> {
    let program = Program::new(&Tiles::in_one_piece(plan))?;
    block_on(engine::solve(backend, &program, pair, observer, inspector))
}

/// Matches `pair` in `tiles`.
pub fn solve_tiles(
    backend: &mut dyn Backend,
    tiles: &Tiles,
    pair: &Pair,
    observer: Observer<'_>,
) -> mrfgs::Result<Solution> {
    block_on(engine::solve(backend, &Program::new(tiles)?, pair, observer, None))
}
