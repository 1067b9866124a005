//! Benchmarks of every stage and of whole matches, with the same cases on every backend: `cargo bench`.
//!
//! The cases are the generated pairs of `mrfgs bench`: the small one, and with `MRFGS_BENCH_LARGE=1` also the large one, which takes long
//! and about 20 GB per backend. `cargo bench -- dependency` runs one stage. Without a driver, the GPU rows are skipped with a note.

#[path = "../cli/src/commands/bench/synthetic.rs"]
mod synthetic;

use criterion::{Criterion, criterion_group, criterion_main};
use mrfgs::low_level::backend::cpu::Cpu;
use mrfgs::low_level::backend::gpu::Gpu;
use mrfgs::low_level::backend::{Backend, Stage};
use mrfgs::low_level::engine;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::program::Program;
use mrfgs::low_level::program::tiles::Tiles;
use mrfgs::options::Method;
use pollster::block_on;
use std::ops::ControlFlow;
use std::time::Duration;
use synthetic::{LARGE, SMALL, Synthetic};

/// The pairs with their presets; the large pair with the preset paper would not fit into most memories.
fn cases() -> Vec<(Synthetic, &'static [&'static str])> {
    let large = std::env::var("MRFGS_BENCH_LARGE").is_ok_and(|v| v != "0" && !v.is_empty());
    let mut cases = vec![(SMALL, &["default", "paper"][..])];
    cases.extend(large.then_some((LARGE, &["default"][..])));
    cases
}

/// The timed groups of stages, with names.
fn groups(plan: &Plan) -> Vec<(&'static str, Vec<Stage>)> {
    let pyramid = (1..plan.levels.len()).map(Stage::Pyramid).collect();
    vec![
        ("graph", (0..plan.levels.len()).map(Stage::Graph).collect()),
        ("cost", vec![Stage::Cost]),
        ("pyramid", pyramid),
        ("evidence", vec![Stage::Evidence(0)]),
        ("dependency", vec![Stage::Dependency(0)]),
        ("resolution", vec![Stage::Resolution(1)]),
        ("belief", vec![Stage::Belief(0)]),
        ("flood", vec![Stage::Flood(0)]),
        ("winner_takes_all", vec![Stage::WinnerTakesAll, Stage::RightView, Stage::SubPixel]),
        ("speckle_filter", vec![Stage::LeftRightCheck, Stage::SpeckleFilter]),
        ("fill", vec![Stage::Fill, Stage::VoteFill, Stage::FillPlane]),
        ("median", vec![Stage::Median]),
        ("plane", vec![Stage::Plane]),
    ]
}

fn bench_backend(criterion: &mut Criterion, name: &str, backend: &mut dyn Backend) {
    for (case, presets) in cases() {
        let (pair, range) = (case.pair().expect("one size"), case.range().expect("a range"));
        for preset in presets {
            let method = Method::preset(preset).expect("a preset");
            let plan = Plan::new(case.width, case.height, range, &method).expect("a plan");
            let program = Program::new(&Tiles::in_one_piece(&plan)).expect("one size");
            let mut group = criterion.benchmark_group(format!("{}/{preset}", case.name));
            group
                .sample_size(10)
                .measurement_time(Duration::from_secs(2))
                .warm_up_time(Duration::from_millis(500));

            // A full match first computes the inputs of all stages and warms up the device.
            block_on(engine::solve(backend, &program, &pair, &mut |_| ControlFlow::Continue(()), None))
                .expect("a match");
            for (stage, stages) in groups(&plan) {
                group.bench_function(format!("{stage}/{name}"), |b| {
                    b.iter(|| {
                        for &stage in &stages {
                            backend.run(stage).expect("a stage");
                        }
                        block_on(backend.wait()).expect("a device that goes on");
                    });
                });
            }
            group.bench_function(format!("match/{name}"), |b| {
                b.iter(|| {
                    block_on(engine::solve(
                        backend,
                        &program,
                        &pair,
                        &mut |_| ControlFlow::Continue(()),
                        None,
                    ))
                    .expect("a match")
                });
            });
            group.finish();
        }
    }
}

fn stages(criterion: &mut Criterion) {
    bench_backend(criterion, "cpu", &mut Cpu::default());
    match Gpu::new(None) {
        Ok(mut gpu) => bench_backend(criterion, "gpu", &mut gpu),
        Err(e) => eprintln!("no GPU rows: {e}"),
    }
}

criterion_group!(benches, stages);
criterion_main!(benches);
