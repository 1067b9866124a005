//! The matcher for JavaScript.

use crate::Thrown;
use crate::matched::Matched;
use crate::pair::{Range, StereoPair};
use crate::words::thrown;
use js_sys::Function;
use mrfgs::low_level::backend::Backend;
use mrfgs::low_level::backend::gpu::{FaultInjection, Gpu};
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::program::tiles::Tiles;
use mrfgs::options::{DeviceChoice, Execution, MatchSize, Method};
use mrfgs::{AutoRange, Error, Progress, Result};
use std::cell::RefCell;
use std::ops::ControlFlow;
use std::sync::Arc;
use wasm_bindgen::JsValue;
use wasm_bindgen::prelude::wasm_bindgen;

thread_local! {
    /// Progress callback of the current match. It is stored here, as the library requires callbacks that can be sent between threads.
    static LISTENER: RefCell<Option<Function>> = const { RefCell::new(None) };
}

/// Memory limit of a match in MiB. WebAssembly can address 4 GiB, which also hold the views, their pictures and the maps.
pub const MEMORY: u32 = 1536;

/// Matches pairs one after another, and keeps the device open in between.
#[wasm_bindgen]
pub struct Matcher {
    matcher: mrfgs::Matcher,
    device: String,
}

#[wasm_bindgen]
impl Matcher {
    /// Opens the device "gpu", which falls back to the CPU if it fails later, or "cpu".
    ///
    /// # Errors
    /// If the browser provides no GPU.
    pub async fn open(device: &str) -> Thrown<Matcher> {
        open(device).await.map_err(thrown)
    }

    /// The device that runs matches, for display.
    #[wasm_bindgen(getter)]
    pub fn device(&self) -> String {
        self.device.clone()
    }

    /// Matches `pair` over `range`, with what is known of it. `progress` is called with the stage and the fraction of the work done, and
    /// returns whether to continue.
    /// With `half`, the pair is matched at half size. A pair that needs more than [`MEMORY`] is matched in tiles.
    ///
    /// # Errors
    /// If the pair cannot be matched, or `progress` stopped the match.
    #[wasm_bindgen(js_name = "match")]
    pub async fn run(
        &mut self,
        pair: &StereoPair,
        preset: &str,
        range: &Range,
        progress: Function,
        half: Option<bool>,
    ) -> Thrown<Matched> {
        let method = method(preset, half.unwrap_or(false)).map_err(thrown)?;
        LISTENER.set(Some(progress));
        let job = if range.found {
            self.matcher.job(&pair.pair, AutoRange(range.range))
        } else {
            self.matcher.job(&pair.pair, range.range)
        };
        let job = match &pair.prior {
            Some(prior) => job.prior(Arc::clone(prior)),
            None => job,
        };
        let matched = job.method(&method).on_progress(tell).run_async().await;
        LISTENER.set(None);
        Ok(Matched { matched: matched.map_err(thrown)? })
    }
}

/// The number of tiles in which a pair would be matched.
///
/// # Errors
/// If no tile is small enough.
#[wasm_bindgen]
pub fn tiles(pair: &StereoPair, preset: &str, range: &Range, half: bool) -> Thrown<usize> {
    let (width, height) = pair.pair.size();
    let count = || {
        let plan =
            Plan::new(width, height, range.range, &method(preset, half)?)?.with_prior(pair.prior.is_some());
        Ok(Tiles::new(&plan)?.count())
    };
    count().map_err(|error: Error| thrown(error))
}

/// The method of a preset, with the memory limit of a browser.
fn method(preset: &str, half: bool) -> Result<Method> {
    let mut method = Method::preset(preset)?;
    method.tiles.memory = method.tiles.memory.min(MEMORY);
    if half {
        method.schedule.match_size = MatchSize::Half;
    }
    Ok(method)
}

async fn open(device: &str) -> Result<Matcher> {
    if device == "cpu" {
        let cpu = Execution { device: DeviceChoice::Cpu, ..Execution::default() };
        let matcher = mrfgs::Matcher::builder().execution(cpu).build_async().await?;
        return Ok(Matcher { matcher, device: "the CPU path".into() });
    }
    // Unlike `auto`, this also accepts software devices.
    let gpu = Gpu::open_async(None, FaultInjection::default()).await?;
    let device = gpu.describe();
    Ok(Matcher { matcher: mrfgs::Matcher::on(Ok(gpu), true, &Execution::default())?, device })
}

/// Calls the progress callback. A callback that throws stops the match.
fn tell(progress: Progress) -> ControlFlow<()> {
    let goes_on = LISTENER.with_borrow(|listener| {
        listener.as_ref().is_none_or(|listener| {
            let answer = listener.call2(&JsValue::NULL, &progress.stage.into(), &progress.done.into());
            answer.is_ok_and(|answer| answer.is_truthy())
        })
    });
    if goes_on { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
}
