//! Pauses between stages, in which the browser does its other work.

use js_sys::{Function, Promise, Reflect};
use std::time::Duration;
use wasm_bindgen::JsCast;
use wasm_bindgen_futures::JsFuture;
use web_time::Instant;

/// How long the thread may be busy without receiving messages. A pause takes some milliseconds.
const BUSY: Duration = Duration::from_millis(100);

/// When to pause.
#[derive(Default)]
pub(crate) struct Pause {
    last: Option<Instant>,
}

impl Pause {
    /// Must be awaited often. If the thread has been busy for a while, lets it receive messages and draw.
    pub(crate) async fn now_and_then(&mut self) {
        if self.last.get_or_insert_with(Instant::now).elapsed() < BUSY {
            return;
        }
        let global = js_sys::global();
        let timer =
            Reflect::get(&global, &"setTimeout".into()).ok().and_then(|f| f.dyn_into::<Function>().ok());
        if let Some(timer) = timer {
            let turn = Promise::new(&mut |resolve, _| {
                // If the timer fails, the match goes on.
                let _ = timer.call1(&global, &resolve);
            });
            let _ = JsFuture::from(turn).await;
        }
        self.last = Some(Instant::now());
    }
}
