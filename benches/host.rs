//! The processor time of the host for a pair of a video on a device, by steps: `cargo bench --bench host [-- gpu]`.
//!
//! By default on a backend that takes no time and computes nothing, so that only the host's work remains; with `gpu` on the preferred
//! device, whose driver may compute on the processor.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a bench that cannot go on panics, and prints its figures"
)]

#[path = "../cli/src/commands/bench/synthetic.rs"]
#[allow(dead_code, reason = "the program has scenes of its own")]
mod synthetic;

use mrfgs::low_level::backend::gpu::{FaultInjection, Gpu};
use mrfgs::low_level::engine;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::program::Program;
use mrfgs::low_level::program::tiles::Tiles;
use mrfgs::{Conditioning, Method, Progress};
use pollster::block_on;
use std::ops::ControlFlow;
use synthetic::Synthetic;

const PAIRS: [Synthetic; 3] = [
    Synthetic { name: "Middlebury", width: 450, height: 375, labels: 60 },
    Synthetic { name: "VGA", width: 640, height: 480, labels: 64 },
    Synthetic { name: "HD", width: 1280, height: 720, labels: 128 },
];
const ROUNDS: usize = 15;

/// Processor time of all threads so far, in ms.
#[cfg(unix)]
fn processor() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 / 1e6
}

/// Wall-clock time so far, in ms, where no crate in use tells the processor time.
#[cfg(not(unix))]
fn processor() -> f64 {
    static START: std::sync::LazyLock<std::time::Instant> = std::sync::LazyLock::new(std::time::Instant::now);
    START.elapsed().as_secs_f64() * 1e3
}

fn main() {
    let noop = !std::env::args().any(|argument| argument == "gpu");
    println!("ms of processor time per pair; wall-clock time of single steps");
    println!(
        "`first` measures the faults of the rig, as every 30th frame of a video does; `between` does not"
    );
    for pair in PAIRS {
        for preset in ["fast", "default"] {
            for measures in [true, false] {
                measure(&pair, preset, noop, measures);
            }
        }
    }
}

fn measure(scene: &Synthetic, preset: &str, noop: bool, measures: bool) {
    let mut gpu = Gpu::with_faults(None, FaultInjection { noop, ..FaultInjection::default() }).unwrap();
    let (pair, range) = (scene.pair().unwrap(), scene.range().unwrap());
    let method = Method::preset(preset).unwrap();
    let plan = Plan::new(scene.width, scene.height, range, &method).unwrap();
    // Most frames take the corrections that were measured on an earlier one.
    let program = Program::new(&Tiles::new(&plan).unwrap()).unwrap();
    let program = program.corrected((!measures).then(Conditioning::default));
    let quiet = &mut |_: Progress| ControlFlow::Continue(());
    let (mut first, mut starts, mut ends) = (0.0, f64::MAX, f64::MAX);
    let mut steps = Vec::new();
    for round in 0..ROUNDS {
        let began = processor();
        let run = block_on(engine::start(&mut gpu, &program, &pair, quiet)).unwrap();
        let started = processor();
        let solution = block_on(engine::finish(&mut gpu, run, &pair)).unwrap();
        if round == 0 {
            first = processor() - began;
            continue;
        }
        (starts, ends) = (starts.min(started - began), ends.min(processor() - started));
        for (i, (name, time)) in solution.host_times.iter().enumerate() {
            let time = time.as_secs_f64() * 1e3;
            match steps.get_mut(i) {
                None => steps.push((*name, time)),
                Some((_, best)) => *best = time.min(*best),
            }
        }
    }
    let steps: Vec<_> = steps.iter().map(|(name, time)| format!("{name} {time:.2}")).collect();
    let frame = if measures { "first" } else { "between" };
    let Synthetic { name, width, height, labels } = scene;
    println!(
        "{name:10} {width:4} x {height:3} x {labels:3} {preset:7} {frame:7}: {:6.2} (start {starts:.2}, finish {ends:.2}; first pair {first:.0}); {}",
        starts + ends,
        steps.join(", ")
    );
}
