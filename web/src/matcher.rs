//! The matcher.

use crate::Thrown;
use crate::matched::Matched;
use crate::pair::{Range, StereoPair};
use crate::words::thrown;
use js_sys::Function;
use mrfgs::options::{DeviceChoice, Execution, Method};
use mrfgs::{Progress, Result};
use std::cell::RefCell;
use std::ops::ControlFlow;
use wasm_bindgen::JsValue;
use wasm_bindgen::prelude::wasm_bindgen;

thread_local! {
    /// Who listens to the match that runs. It stays here, since listeners of the library may move between threads.
    static LISTENER: RefCell<Option<Function>> = const { RefCell::new(None) };
}

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
    /// whether to go on.
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
    ) -> Thrown<Matched> {
        let method = Method::preset(preset).map_err(thrown)?;
        LISTENER.set(Some(progress));
        let job = self.matcher.job(&pair.pair, range.range).method(&method);
        let matched = job.on_progress(tell).run_async().await;
        LISTENER.set(None);
        Ok(Matched { matched: matched.map_err(thrown)? })
    }
}

async fn open(device: &str) -> Result<Matcher> {
    if device == "cpu" {
        let cpu = Execution { device: DeviceChoice::Cpu, ..Execution::default() };
        let matcher = mrfgs::Matcher::builder().execution(cpu).build_async().await?;
        return Ok(Matcher { matcher, device: "the CPU path".into() });
    }
    let gpu = mrfgs::low_level::backend::gpu::Gpu::open_async(None, Default::default()).await?;
    let device = mrfgs::low_level::backend::Backend::describe(&gpu);
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
