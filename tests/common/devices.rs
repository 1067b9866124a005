//! Every backend that this machine can run, for tests that compare each of them with the twins.

use mrfgs::Result;
use mrfgs::image::Plane;
use mrfgs::low_level::backend::cpu::Cpu;
use mrfgs::low_level::backend::gpu::{FaultInjection, Gpu};
use mrfgs::low_level::backend::probe::Probe;
use mrfgs::low_level::backend::{Backend, Map, Promise, Stage, Ticket, Traffic};
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::program::{Program, Run};
use mrfgs::maps::Maps;
use std::io::Write;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Idle devices, because opening a device and compiling its shaders takes longer than most tests.
static IDLE: Mutex<Vec<Gpu>> = Mutex::new(Vec::new());

/// Reports on stderr that there is no GPU, or panics if `MRFGS_REQUIRE_GPU` is set and not 0.
pub fn skip(reason: &dyn std::fmt::Display) {
    let required = std::env::var("MRFGS_REQUIRE_GPU").is_ok_and(|v| v != "0" && !v.is_empty());
    assert!(!required, "MRFGS_REQUIRE_GPU is set and there is none: {reason}");
    // Bypasses the output capture of the test harness: a test without its GPU must not look like a passed one.
    let _ = writeln!(std::io::stderr(), "SKIPPED on the GPU: {reason}");
}

/// A separate GPU with injected faults. Without a driver it is `None`, or a [panic](skip).
pub fn open(faults: FaultInjection) -> Option<Gpu> {
    match Gpu::with_faults(None, faults) {
        Ok(gpu) => Some(gpu),
        Err(e) => {
            skip(&e);
            None
        }
    }
}

/// A device, an idle one if possible.
pub fn gpu() -> Option<Pooled> {
    let idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner).pop();
    idle.or_else(|| open(FaultInjection::default())).map(|gpu| Pooled(Some(gpu)))
}

/// The name and a fresh instance of every backend.
///
/// The twins are not a backend and never in this list: a backend compared with itself would always pass.
pub fn backends() -> Vec<(String, Box<dyn Backend>)> {
    let mut all: Vec<(String, Box<dyn Backend>)> = vec![("cpu".into(), Box::new(Cpu::default()))];
    if let Some(gpu) = gpu() {
        all.push((gpu.describe(), Box::new(gpu)));
    }
    all
}

/// A device that returns to [`IDLE`] when it is dropped.
pub struct Pooled(Option<Gpu>);

impl Pooled {
    fn gpu(&mut self) -> &mut Gpu {
        self.0.as_mut().expect("there until it is dropped")
    }
}

impl Drop for Pooled {
    fn drop(&mut self) {
        // A panicking test may leave it in any state.
        if let Some(gpu) = self.0.take().filter(|_| !std::thread::panicking()) {
            IDLE.lock().unwrap_or_else(PoisonError::into_inner).push(gpu);
        }
    }
}

impl Backend for Pooled {
    fn describe(&self) -> String {
        self.0.as_ref().expect("there until it is dropped").describe()
    }

    fn prepare(&mut self, plan: &Plan, prepared: Prepared) -> Result<()> {
        self.gpu().prepare(plan, prepared)
    }

    fn fit(&mut self, program: Program) -> Program {
        self.gpu().fit(program)
    }

    fn perform(&mut self, run: &Run) -> Result<()> {
        self.gpu().perform(run)
    }

    fn keep_up(&mut self) -> Promise<'_, ()> {
        self.gpu().keep_up()
    }

    fn settled(&mut self, wait: bool) -> Promise<'_, bool> {
        self.gpu().settled(wait)
    }

    fn idle_iterations(&mut self) -> Promise<'_, u32> {
        self.gpu().idle_iterations()
    }

    fn wait(&mut self) -> Promise<'_, ()> {
        self.gpu().wait()
    }

    fn map(&mut self, map: Map) -> Promise<'_, Plane<i32>> {
        self.gpu().map(map)
    }

    fn request_maps(&mut self) -> Result<Ticket> {
        self.gpu().request_maps()
    }

    fn maps(&mut self, ticket: Ticket) -> Promise<'_, (Maps, u32)> {
        self.gpu().maps(ticket)
    }

    fn keep_time(&mut self, on: bool) -> Result<()> {
        self.gpu().keep_time(on)
    }

    fn times(&mut self) -> Promise<'_, Vec<(Stage, Duration)>> {
        self.gpu().times()
    }

    fn cells(&self) -> Vec<u64> {
        self.0.as_ref().expect("there until it is dropped").cells()
    }

    fn traffic(&self) -> Traffic {
        self.0.as_ref().expect("there until it is dropped").traffic()
    }

    fn probe(&mut self) -> &mut dyn Probe {
        self.gpu().probe()
    }
}
