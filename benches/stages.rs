//! Every stage and the whole match, the same cases on every backend: `cargo bench`.
//!
//! `cargo bench -- dependency` runs one stage. The GPU rows are missing where there is no driver, and say so.

#[path = "../testdata/scenes.rs"]
mod scenes;

use criterion::{Criterion, criterion_group, criterion_main};
use mrfgs::backend::cpu::Cpu;
use mrfgs::backend::gpu::Gpu;
use mrfgs::backend::{Backend, Volume};
use mrfgs::image::{Image, Pair};
use mrfgs::options::{DisparityRange, Method};
use mrfgs::plan::Plan;
use mrfgs::{graph, refine, solver};
use std::hint::black_box;
use std::ops::ControlFlow;
use std::time::Duration;

/// Name, width, height and labels of the cases.
const CASES: [(&str, usize, usize, u32); 2] = [("small", 160, 120, 24), ("quarter", 450, 375, 60)];

fn pair_of(width: usize, height: usize, labels: u32) -> Pair {
    let scene = scenes::render("mixed", width, height, labels);
    Pair::new(Image::from_rgb8(&scene.left), Image::from_rgb8(&scene.right)).expect("one size")
}

/// Waits for the device: commands are recorded and run later.
fn settle(backend: &mut dyn Backend, coarsest: usize) {
    black_box(backend.read(Volume::Evidence(coarsest)).expect("a volume"));
}

fn bench_backend(criterion: &mut Criterion, name: &str, backend: &mut dyn Backend) {
    for (case, width, height, labels) in CASES {
        let pair = pair_of(width, height, labels);
        let range = DisparityRange::new(0, labels as i32 - 1).expect("a range");
        for preset in ["default", "paper"] {
            let method = Method::preset(preset).expect("a preset");
            let plan = Plan::new(width, height, range, &method).expect("a plan");
            let coarsest = plan.levels.len() - 1;
            let mut group = criterion.benchmark_group(format!("{case}/{preset}"));
            group
                .sample_size(10)
                .measurement_time(Duration::from_secs(2))
                .warm_up_time(Duration::from_millis(500));

            // Whatever a stage needs is there, and the device is warm.
            let solution =
                solver::solve(backend, &plan, &pair, &mut |_| ControlFlow::Continue(())).expect("a match");
            group.bench_function(format!("cost/{name}"), |b| {
                b.iter(|| {
                    backend.cost().expect("cost");
                    settle(backend, coarsest);
                });
            });
            group.bench_function(format!("pyramid/{name}"), |b| {
                b.iter(|| {
                    (1..=coarsest).for_each(|z| backend.pyramid(z).expect("pyramid"));
                    settle(backend, coarsest);
                });
            });
            group.bench_function(format!("dependency/{name}"), |b| {
                b.iter(|| {
                    backend.dependency(0).expect("dependency");
                    settle(backend, coarsest);
                });
            });
            group.bench_function(format!("resolution/{name}"), |b| {
                b.iter(|| {
                    backend.resolution(1).expect("resolution");
                    settle(backend, coarsest);
                });
            });
            group.bench_function(format!("belief/{name}"), |b| {
                b.iter(|| {
                    backend.belief(0).expect("belief");
                    settle(backend, coarsest);
                });
            });
            group.bench_function(format!("estimate/{name}"), |b| {
                b.iter(|| black_box(backend.estimate().expect("an estimate")));
            });
            group.bench_function(format!("match/{name}"), |b| {
                b.iter(|| {
                    solver::solve(backend, &plan, &pair, &mut |_| ControlFlow::Continue(())).expect("a match")
                });
            });
            if name == "cpu" {
                group.bench_function("graph", |b| b.iter(|| graph::build(pair.left(), &plan)));
                let weights = refine::MedianWeights::new(15, 5.0, 0.1);
                group.bench_function("median", |b| {
                    b.iter(|| {
                        refine::weighted_median(
                            &solution.raw,
                            &solution.validity,
                            pair.left(),
                            &weights,
                            |_| true,
                        )
                    });
                });
            }
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
