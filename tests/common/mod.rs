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
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::graph::{self, LevelGraph};
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::solver::{self, Run};
use mrfgs::low_level::watch::Watch;
use pollster::block_on;
use std::ops::ControlFlow;

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

/// Prepares `backend` for a match of `pair` by `plan`, on `graphs`.
pub fn prepare(backend: &mut dyn Backend, plan: &Plan, pair: &Pair, graphs: &[LevelGraph]) {
    backend.prepare(plan, Prepared::new(pair)).unwrap();
    for (z, graph) in graphs.iter().enumerate() {
        backend.probe().set_graph(z, graph).unwrap();
    }
}

/// Runs the message passing of `plan` on the evidence that `backend` holds; returns the number of iterations.
pub fn flood(backend: &mut dyn Backend, plan: &Plan) -> mrfgs::Result<u32> {
    let mut go_on = |_| ControlFlow::Continue(());
    let watch = Watch::new(&mut go_on, 1.0);
    let nothing = async |_: &mut dyn Backend, _: &mut Run<'_, '_>, _| Ok(());
    block_on(solver::flood(backend, plan, &mut Run::new(watch, None), nothing))
}

/// The same on the costs that `backend` holds.
pub fn flood_on_costs(backend: &mut dyn Backend, plan: &Plan) -> mrfgs::Result<u32> {
    let mut go_on = |_| ControlFlow::Continue(());
    let watch = Watch::new(&mut go_on, 1.0);
    let join =
        async |backend: &mut dyn Backend, run: &mut Run<'_, '_>, z| solver::join(backend, plan, run, z).await;
    block_on(solver::flood(backend, plan, &mut Run::new(watch, None), join))
}
