//! Counts the work of the host for a pair on a device. The backend accepts every command and computes nothing, so
//! no driver is needed.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on panics")]

#[path = "../cli/src/commands/bench/synthetic.rs"]
#[allow(dead_code, reason = "the program has scenes of its own")]
mod synthetic;

use mrfgs::low_level::backend::Traffic;
use mrfgs::low_level::backend::gpu::{FaultInjection, Gpu};
use mrfgs::low_level::engine;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::program::Program;
use mrfgs::low_level::program::tiles::Tiles;
use mrfgs::{Method, Progress};
use pollster::block_on;
use std::ops::ControlFlow;
use synthetic::Synthetic;

const PAIR: Synthetic = Synthetic { name: "video", width: 640, height: 480, labels: 64 };

/// The most of each count, for a pair of 640 x 480 pixels and 64 labels. Lower a limit when its count falls.
struct Limits {
    dispatches: u64,
    passes: u64,
    submissions: u64,
    /// Bytes per pixel.
    up: u64,
    down: u64,
    /// Bytes: the state of convergence starts from zeros.
    cleared: u64,
}

const FAST: Limits = Limits { dispatches: 106, passes: 2, submissions: 1, up: 8, down: 6, cleared: 24 };
const DEFAULT: Limits = Limits { dispatches: 224, passes: 3, submissions: 2, up: 8, down: 6, cleared: 24 };

/// The counts of each of `rounds` pairs that overlap: each is started before the one before it is finished.
fn counts(preset: &str, rounds: usize) -> Vec<Traffic> {
    let mut gpu = Gpu::with_faults(None, FaultInjection { noop: true, ..FaultInjection::default() }).unwrap();
    let (pair, range) = (PAIR.pair().unwrap(), PAIR.range().unwrap());
    let plan = Plan::new(PAIR.width, PAIR.height, range, &Method::preset(preset).unwrap()).unwrap();
    let program = Program::new(&Tiles::new(&plan).unwrap()).unwrap();
    let quiet = &mut |_: Progress| ControlFlow::Continue(());
    let mut start = |gpu: &mut Gpu| block_on(engine::start(gpu, &program, &pair, quiet)).unwrap();
    let finish = |gpu: &mut Gpu, run| block_on(engine::finish(gpu, run, &pair)).unwrap().traffic;
    let mut last = start(&mut gpu);
    let mut all = Vec::new();
    for _ in 1..rounds {
        let next = start(&mut gpu);
        all.push(finish(&mut gpu, last));
        last = next;
    }
    all.push(finish(&mut gpu, last));
    all
}

#[test]
fn a_pair_of_a_sequence_costs_no_more_than_before() {
    for (preset, limits) in [("fast", FAST), ("default", DEFAULT)] {
        let all = counts(preset, 4);
        let last = all[3];
        assert_eq!(all[2], last, "{preset}: all pairs of a sequence cost the same");
        let pixels = (PAIR.width * PAIR.height) as u64;
        for (name, count, most) in [
            ("dispatches", last.dispatches, limits.dispatches),
            ("passes", last.passes, limits.passes),
            ("submissions", last.submissions, limits.submissions),
            ("bytes up", last.bytes_up, limits.up * pixels),
            ("bytes down", last.bytes_down, limits.down * pixels),
            ("bytes cleared", last.bytes_cleared, limits.cleared),
            ("waits before its maps are asked for", last.waits, 0),
            ("new buffers", last.buffers, 0),
        ] {
            eprintln!("{preset}: {name}: {count}");
            assert!(count <= most, "{preset}: {name}: {count}, more than {most}");
        }
        // The limits are tight, and the counts are real.
        assert!(last.dispatches == limits.dispatches && last.bytes_down == limits.down * pixels, "{preset}");
        assert!(last.passes == limits.passes, "{preset}");
        assert!(all[0].buffers > 0, "{preset}: the first pair allocates");
    }
}
