//! Pauses between stages, so that a browser can do other work. Native programs have threads, and need none.

/// When to pause.
#[derive(Default)]
pub(crate) struct Pause;

impl Pause {
    /// Must be awaited often.
    #[allow(clippy::unused_async, clippy::unused_self, reason = "it has something to do in a browser")]
    pub(crate) async fn now_and_then(&mut self) {}
}
