//! Every backend that this machine can run, for tests that hold each of them to the twins.

use mrfgs::Result;
use mrfgs::backend::cpu::Cpu;
use mrfgs::backend::gpu::{Ceiling, Gpu};
use mrfgs::backend::{Backend, Estimate, Volume};
use mrfgs::graph::LevelGraph;
use mrfgs::image::Pair;
use mrfgs::plan::Plan;
use std::io::Write;
use std::sync::{LazyLock, Mutex, MutexGuard, PoisonError};

/// One device for all tests of a binary: opening it and compiling its shaders takes longer than most of them.
static GPU: LazyLock<Option<Mutex<Gpu>>> = LazyLock::new(|| open(Ceiling::default()).map(Mutex::new));

/// A GPU of its own, kept below `ceiling`. `None`, said on stderr, where there is no driver; a panic where
/// `MRFGS_REQUIRE_GPU` is set and not 0.
pub fn open(ceiling: Ceiling) -> Option<Gpu> {
    match Gpu::with_ceiling(None, ceiling) {
        Ok(gpu) => Some(gpu),
        Err(e) => {
            let required = std::env::var("MRFGS_REQUIRE_GPU").is_ok_and(|v| v != "0" && !v.is_empty());
            assert!(!required, "MRFGS_REQUIRE_GPU is set and there is none: {e}");
            // Past the capture of the test harness: a test without its GPU must not look like one that passed.
            let _ = writeln!(std::io::stderr(), "SKIPPED on the GPU: {e}");
            None
        }
    }
}

/// The device of this binary, for as long as the guard lives.
pub fn gpu() -> Option<Shared> {
    GPU.as_ref().map(|gpu| Shared(gpu.lock().unwrap_or_else(PoisonError::into_inner)))
}

/// Name and a fresh instance of every backend.
///
/// The twins are no backend and never in this list: a backend that were compared with itself would always pass.
pub fn backends() -> Vec<(String, Box<dyn Backend>)> {
    let mut all: Vec<(String, Box<dyn Backend>)> = vec![("cpu".into(), Box::new(Cpu::default()))];
    if let Some(gpu) = gpu() {
        all.push((gpu.describe(), Box::new(gpu)));
    }
    all
}

/// The shared device, locked.
pub struct Shared(MutexGuard<'static, Gpu>);

impl Backend for Shared {
    fn describe(&self) -> String {
        self.0.describe()
    }

    fn prepare(&mut self, plan: &Plan, pair: &Pair, graphs: Vec<LevelGraph>) -> Result<()> {
        self.0.prepare(plan, pair, graphs)
    }

    fn cost(&mut self) -> Result<()> {
        self.0.cost()
    }

    fn pyramid(&mut self, level: usize) -> Result<()> {
        self.0.pyramid(level)
    }

    fn evidence(&mut self, level: usize) -> Result<()> {
        self.0.evidence(level)
    }

    fn dependency(&mut self, level: usize) -> Result<()> {
        self.0.dependency(level)
    }

    fn resolution(&mut self, level: usize) -> Result<()> {
        self.0.resolution(level)
    }

    fn belief(&mut self, level: usize) -> Result<()> {
        self.0.belief(level)
    }

    fn change(&mut self) -> Result<u64> {
        self.0.change()
    }

    fn estimate(&mut self) -> Result<Estimate> {
        self.0.estimate()
    }

    fn read(&mut self, volume: Volume) -> Result<Vec<u32>> {
        self.0.read(volume)
    }

    fn write(&mut self, volume: Volume, values: &[u32]) -> Result<()> {
        self.0.write(volume, values)
    }
}
