//! Pauses between stages, in which the browser does its other work.

use js_sys::{Function, Promise, Reflect};
use std::time::Duration;
use wasm_bindgen::JsCast;
use wasm_bindgen_futures::JsFuture;
use web_time::Instant;

/// How long the thread may be busy before its messages are looked at. A pause takes some milliseconds.
const BUSY: Duration = Duration::from_millis(100);

/// When to pause.
#[derive(Default)]
pub(crate) struct Pause {
    last: Option<Instant>,
}

impl Pause {
    /// To be awaited often: lets the thread receive messages, and a window draw, if it has been busy for a while.
    pub(crate) async fn now_and_then(&mut self) {
        if self.last.get_or_insert_with(Instant::now).elapsed() < BUSY {
            return;
        }
        let global = js_sys::global();
        let timer =
            Reflect::get(&global, &"setTimeout".into()).ok().and_then(|f| f.dyn_into::<Function>().ok());
        if let Some(timer) = timer {
            let turn = Promise::new(&mut |resolve, _| {
                // Without a turn the match goes on.
                let _ = timer.call1(&global, &resolve);
            });
            let _ = JsFuture::from(turn).await;
        }
        self.last = Some(Instant::now());
    }
}
