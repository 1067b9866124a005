//! Pauses between stages. A browser needs them for its other work; where a program has threads of its own, there are none.

/// When to pause.
#[derive(Default)]
pub(crate) struct Pause;

impl Pause {
    /// To be awaited often.
    #[allow(clippy::unused_async, clippy::unused_self, reason = "it has something to do in a browser")]
    pub(crate) async fn now_and_then(&mut self) {}
}
