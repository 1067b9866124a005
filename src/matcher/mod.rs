//! The entry point: matches pairs. It opens a backend, checks it, and falls back to the CPU path if allowed.

mod check;
mod corrections;
mod following;
mod frame;
mod in_blocks;
mod job;
mod matched;
pub mod on_device;
mod search;
mod sequence;
#[cfg(not(target_arch = "wasm32"))]
mod shared;
#[cfg(not(target_arch = "wasm32"))]
mod side_by_side;

use crate::backend::Backend;
use crate::backend::cpu::Cpu;
use crate::backend::gpu::{self, FaultInjection, Gpu};
use crate::engine::{self, Inspector};
use crate::error::{BudgetError, Error, Result};
use crate::front::conditioning::Conditioning;
use crate::image::{Pair, Rect};
use crate::options::{DeviceChoice, DisparityRange, Execution, Method};
use crate::plan::Plan;
use crate::prior::Prior;
use crate::program::Program;
use crate::program::tiles::Tiles;
use crate::region::{Blocks, Region};
use crate::threads::Threads;
use crate::watch::Observer;
use check::check;
pub use frame::Frame;
pub use job::{Answer, Job};
use matched::summed;
pub use matched::{Matched, Timing};
pub use search::{AutoRange, Search};
#[cfg(not(target_arch = "wasm32"))]
pub use shared::SharedMatcher;
use std::sync::Arc;

/// Configures a [`Matcher`].
#[derive(Clone, Debug, Default)]
#[must_use = "a builder does nothing until `build`"]
pub struct Builder {
    method: Method,
    execution: Execution,
}

impl Builder {
    /// The method; the default is the preset `default`.
    pub fn method(self, method: Method) -> Self {
        Self { method, ..self }
    }

    /// The backend: `"auto"`, `"cpu"`, `"gpu"`, or the index of a device or a part of its name. The choice
    /// does not change the maps.
    pub fn device(mut self, device: impl Into<DeviceChoice>) -> Self {
        self.execution.device = device.into();
        self
    }

    /// The most threads of the CPU path; by default the [usual](crate::threads::usual) number.
    pub fn threads(mut self, threads: usize) -> Self {
        self.execution.threads = Some(threads);
        self
    }

    /// Whether to measure the time of every stage.
    pub fn timings(mut self, timings: bool) -> Self {
        self.execution.timings = timings;
        self
    }

    /// Sets device, threads and timings at once.
    pub fn execution(self, execution: Execution) -> Self {
        Self { execution, ..self }
    }

    /// Opens the device.
    ///
    /// # Errors
    /// [`Error::Execution`] for invalid choices and for a device that does not exist, [`Error::Device`] when
    /// there is no driver or the device cannot be opened.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn build(self) -> Result<Matcher> {
        pollster::block_on(self.build_async())
    }

    /// Like `build`, for a browser, which must not block.
    ///
    /// # Errors
    /// The errors of `build`.
    pub async fn build_async(self) -> Result<Matcher> {
        let threads = Arc::new(Threads::new(self.execution.threads)?);
        self.build_on(threads).await
    }

    /// Builds a matcher on existing threads.
    async fn build_on(self, threads: Arc<Threads>) -> Result<Matcher> {
        let Self { method, execution } = self;
        let open = |wanted| Gpu::open_async(wanted, FaultInjection::default());
        let (gpu, falls_back) = match &execution.device {
            DeviceChoice::Cpu => (None, false),
            DeviceChoice::Gpu => (Some(open(None).await), false),
            DeviceChoice::Named(name) => (Some(open(Some(name)).await), false),
            DeviceChoice::Auto if gpu::has_automatic_async().await => (Some(open(None).await), true),
            DeviceChoice::Auto => (None, true),
        };
        Matcher::build(method, gpu, falls_back, threads, execution.timings)
    }
}

/// Matches pairs one after another, and keeps the device, its compiled shaders and its buffers in between.
pub struct Matcher {
    method: Method,
    threads: Arc<Threads>,
    /// CPU paths with their reusable memory: one for each pair that was matched in parallel.
    cpus: Vec<Cpu>,
    gpu: Option<Gpu>,
    /// The last method whose maps on this device were verified against the CPU path.
    checked: Option<Method>,
    /// Whether the CPU path may replace a failing device.
    falls_back: bool,
    /// The error because of which the device was dropped.
    given_up: Option<Error>,
    timings: bool,
}

/// How a pair is matched.
#[derive(Clone, Copy)]
struct Request<'a> {
    range: DisparityRange,
    method: &'a Method,
    /// Corrections that are not measured on the pair itself.
    known: Option<Conditioning>,
    prior: Option<&'a Arc<Prior>>,
}

impl Matcher {
    /// A matcher of the preset `default`, on a GPU if there is one, else on the CPU path.
    ///
    /// # Errors
    /// The errors of [`Builder::build`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn new() -> Result<Self> {
        Self::builder().build()
    }

    /// Configures a matcher.
    pub fn builder() -> Builder {
        Builder::default()
    }

    /// A matcher of the preset `default` on a device that is open already. It does not fall back to the CPU path.
    ///
    /// # Errors
    /// [`Error::Execution`] for an invalid number of threads.
    pub fn on_device(open: gpu::OpenDevice, threads: Option<usize>) -> Result<Self> {
        let execution = Execution { threads, ..Execution::default() };
        Self::on(Ok(Gpu::of_caller(open)), false, &execution)
    }

    /// A matcher on `gpu`; if that fails or cannot serve, on the CPU path if it `falls_back`.
    ///
    /// # Errors
    /// [`Error::Execution`] for an invalid number of threads, and the error of `gpu` unless it falls back.
    #[doc(hidden)]
    pub fn on(gpu: Result<Gpu>, falls_back: bool, execution: &Execution) -> Result<Self> {
        let threads = Arc::new(Threads::new(execution.threads)?);
        Self::build(Method::default(), Some(gpu), falls_back, threads, execution.timings)
    }

    fn build(
        method: Method,
        gpu: Option<Result<Gpu>>,
        falls_back: bool,
        threads: Arc<Threads>,
        timings: bool,
    ) -> Result<Self> {
        let (gpu, given_up) = match gpu.transpose() {
            Ok(gpu) => (gpu, None),
            Err(e @ (Error::Device(_) | Error::Memory(_))) if falls_back => (None, Some(e)),
            Err(e) => return Err(e),
        };
        Ok(Self { method, threads, cpus: Vec::new(), gpu, checked: None, falls_back, given_up, timings })
    }

    /// Matches by `method` from now on.
    pub fn set_method(&mut self, method: Method) {
        self.method = method;
    }

    /// Turns per-stage timing on or off.
    pub fn keep_time(&mut self, on: bool) {
        self.timings = on;
    }

    /// Matches a region of the left view of `pair`, or all of it.
    async fn solve_part(
        &mut self,
        pair: &Pair,
        part: Option<&Rect>,
        request: Request<'_>,
        observer: Observer<'_>,
        inspector: Option<Inspector<'_>>,
    ) -> Result<Matched> {
        let Some(part) = part else { return self.solve(pair, request, observer, inspector).await };
        let region = Region::new(part.clone(), pair.size(), request.range)?;
        let window = region.window_of(pair);
        if let Some(prior) = request.prior {
            fits(prior, pair)?;
        }
        let prior = request.prior.map(|prior| Arc::new(prior.crop(region.window())));
        let request = Request { prior: prior.as_ref(), ..request };
        let matched = self.solve(&window, request, observer, inspector).await?;
        Ok(Matched { maps: region.maps_of(&matched.maps), ..matched })
    }

    /// Matches `pair`, in blocks where that pays.
    async fn solve(
        &mut self,
        pair: &Pair,
        request: Request<'_>,
        observer: Observer<'_>,
        inspector: Option<Inspector<'_>>,
    ) -> Result<Matched> {
        let Request { range, method, prior, .. } = request;
        let (width, height) = pair.size();
        let plan = Plan::new(width, height, range, method)?.with_prior(prior.is_some());
        let pays =
            || Ok::<_, Error>(Tiles::pixels(&plan).is_none() || Blocks::pay((width, height), range, method)?);
        // An inspector sees a single match.
        if inspector.is_none() && pays()? {
            return self.solve_in_blocks(pair, request, observer).await;
        }
        self.solve_at_once(pair, request, observer, inspector).await
    }

    /// Matches `pair` in one piece or in tiles, on the device or on the CPU path.
    async fn solve_at_once(
        &mut self,
        pair: &Pair,
        request: Request<'_>,
        observer: Observer<'_>,
        mut inspector: Option<Inspector<'_>>,
    ) -> Result<Matched> {
        let Request { range, method, known, prior } = request;
        let (width, height) = pair.size();
        let plan = Plan::new(width, height, range, method)?.with_prior(prior.is_some());
        if let Some(prior) = prior {
            fits(prior, pair)?;
        }
        let input = (pair, known, prior);
        let tiles = Tiles::new(&plan)?;
        let needed = plan.bytes().div_ceil(1 << 20);
        if inspector.is_some() && needed > plan.method.tiles.memory.into() {
            return Err(BudgetError::Steps { needed }.into());
        }
        let Self { threads, gpu, checked, timings, .. } = self;
        let mut note = None;
        if let Some(device) = gpu {
            let served = async || {
                check(device, &plan.method, checked).await?;
                let inspector = inspector.as_mut().map(|inspector| &mut **inspector as _);
                timed(device, *timings, &tiles, input, &mut *observer, inspector).await
            };
            match threads.run(width * height, served).await? {
                Err(e) => note = Some(self.without_device(e)?),
                served => return served,
            }
        }
        let Self { threads, cpus, given_up, timings, .. } = self;
        let note = note.or_else(|| given_up.clone());
        let mut cpu = cpus.pop().unwrap_or_default();
        let served = async || timed(&mut cpu, *timings, &tiles, input, observer, inspector).await;
        let matched = threads.run(width * height, served).await;
        cpus.push(cpu);
        let matched = matched??;
        Ok(Matched { note, ..matched })
    }

    /// The failure of a device as a note, if the CPU path may replace it. The maps are the same there, so it only costs time.
    ///
    /// # Errors
    /// The failure, if the CPU path may not replace the device.
    fn without_device(&mut self, failure: Error) -> Result<Error> {
        if !self.falls_back || !matches!(failure, Error::Device(_) | Error::Memory(_)) {
            return Err(failure);
        }
        // The next match may fit even if this one is too large.
        if matches!(failure, Error::Device(_)) {
            self.gpu = None;
            self.given_up = Some(failure.clone());
        }
        Ok(failure)
    }
}

/// Checks that `prior` has the size of `pair`.
fn fits(prior: &Prior, pair: &Pair) -> Result<()> {
    let ((w, h), (width, height)) = (prior.size(), pair.size());
    if (w, h) == (width, height) {
        return Ok(());
    }
    Err(Error::Mismatch(format!("the prior has {w} x {h} pixels, the left view {width} x {height}")))
}

/// Matches a pair, with its corrections and a prior of the scene if they are known.
async fn timed(
    backend: &mut dyn Backend,
    timings: bool,
    tiles: &Tiles,
    (pair, known, prior): (&Pair, Option<Conditioning>, Option<&Arc<Prior>>),
    observer: Observer<'_>,
    inspector: Option<Inspector<'_>>,
) -> Result<Matched> {
    backend.keep_time(timings)?;
    let program = Program::new(tiles)?.corrected(known).knowing(prior.cloned());
    let solution = engine::solve(backend, &program, pair, observer, inspector).await?;
    let timings = if timings { summed(&solution, &backend.times().await?) } else { Vec::new() };
    Ok(Matched::new(backend, tiles, solution, timings))
}
