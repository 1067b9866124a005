//! Pauses that a browser needs for its other work.

/// Pauses between stages. Where a program has threads of its own, there are none.
#[derive(Default)]
pub(crate) struct Pause {
    #[cfg(target_arch = "wasm32")]
    last: Option<web_time::Instant>,
}

#[cfg(not(target_arch = "wasm32"))]
impl Pause {
    /// To be awaited often.
    #[allow(clippy::unused_async, clippy::unused_self, reason = "it has something to do in a browser")]
    pub(crate) async fn now_and_then(&mut self) {}
}

#[cfg(target_arch = "wasm32")]
mod browser {
    use super::Pause;
    use js_sys::{Function, Promise, Reflect};
    use std::time::Duration;
    use wasm_bindgen::JsCast;
    use wasm_bindgen_futures::JsFuture;
    use web_time::Instant;

    /// How long the thread may be busy before its messages are looked at. A pause takes some milliseconds.
    const BUSY: Duration = Duration::from_millis(100);

    impl Pause {
        /// Lets the thread receive messages, and a window draw, if it has been busy for a while.
        pub(crate) async fn now_and_then(&mut self) {
            let last = *self.last.get_or_insert_with(Instant::now);
            if last.elapsed() < BUSY {
                return;
            }
            let global = js_sys::global();
            let timer =
                Reflect::get(&global, &"setTimeout".into()).ok().and_then(|f| f.dyn_into::<Function>().ok());
            if let Some(timer) = timer {
                let turn = Promise::new(&mut |resolve, _| {
                    let _ = timer.call1(&global, &resolve);
                });
                let _ = JsFuture::from(turn).await;
            }
            self.last = Some(Instant::now());
        }
    }
}
