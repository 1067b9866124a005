//! The matcher.

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
use wasm_bindgen::JsValue;
use wasm_bindgen::prelude::wasm_bindgen;

thread_local! {
    /// Who listens to the match that runs. It stays here, since listeners of the library may move between threads.
    static LISTENER: RefCell<Option<Function>> = const { RefCell::new(None) };
}

/// What a match may take of the 4 GiB that WebAssembly can address, in MiB: the views, their pictures and the maps are there too.
pub const MEMORY: u32 = 1536;

/// Matches pair after pair, and keeps the device in between.
#[wasm_bindgen]
pub struct Matcher {
    matcher: mrfgs::Matcher,
    device: String,
}

#[wasm_bindgen]
impl Matcher {
    /// Opens "gpu", where the CPU path steps in if it fails later, or "cpu".
    ///
    /// # Errors
    /// Where the browser shows no GPU.
    pub async fn open(device: &str) -> Thrown<Matcher> {
        open(device).await.map_err(thrown)
    }

    /// What runs the stages, for people.
    #[wasm_bindgen(getter)]
    pub fn device(&self) -> String {
        self.device.clone()
    }

    /// Matches `pair` over `range`. `progress` hears of each stage that begins and of the share of the work that is done, and answers
    /// whether to go on. With `half`, the pair is matched at half its size. One that takes more than [`MEMORY`] is matched in tiles.
    ///
    /// # Errors
    /// Where the pair cannot be matched, or the listener has stopped it.
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
        let matched = job.method(&method).on_progress(tell).run_async().await;
        LISTENER.set(None);
        Ok(Matched { matched: matched.map_err(thrown)? })
    }
}

/// The number of tiles in which a pair would be matched.
///
/// # Errors
/// Where no tile is small enough.
#[wasm_bindgen]
pub fn tiles(pair: &StereoPair, preset: &str, range: &Range, half: bool) -> Thrown<usize> {
    let (width, height) = pair.pair.size();
    let count = || {
        let plan = Plan::new(width, height, range.range, &method(preset, half)?)?;
        Ok(Tiles::new(&plan)?.count())
    };
    count().map_err(|error: Error| thrown(error))
}

/// The method of a preset in the memory of a browser.
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
    // Also a software device, which `auto` would not take.
    let gpu = Gpu::open_async(None, FaultInjection::default()).await?;
    let device = gpu.describe();
    Ok(Matcher { matcher: mrfgs::Matcher::on(Ok(gpu), true, &Execution::default())?, device })
}

/// Tells the listener. One that fails cannot answer, and stops the match.
fn tell(progress: Progress) -> ControlFlow<()> {
    let goes_on = LISTENER.with_borrow(|listener| {
        listener.as_ref().is_none_or(|listener| {
            let answer = listener.call2(&JsValue::NULL, &progress.stage.into(), &progress.done.into());
            answer.is_ok_and(|answer| answer.is_truthy())
        })
    });
    if goes_on { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
}
