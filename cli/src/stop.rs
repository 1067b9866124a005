//! Being stopped by Ctrl-C or SIGTERM.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

/// The exit status of what was stopped: as shells have it for SIGINT.
pub(crate) const STOPPED: u8 = 130;

static STOP: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
/// Whether the first signal ends the program.
static AT_ONCE: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// From now on the first signal makes [`go_on`] break, so that what was begun can be tidied up, and the second ends the program
/// as it is.
pub(crate) fn listen() {
    for signal in [SIGINT, SIGTERM] {
        // The order counts: the first signal must find the flag down. Where that fails a signal ends the program at once.
        let _ = flag::register_conditional_shutdown(signal, STOPPED.into(), Arc::clone(&STOP))
            .and_then(|_| flag::register_conditional_shutdown(signal, STOPPED.into(), Arc::clone(&AT_ONCE)))
            .and_then(|_| flag::register(signal, Arc::clone(&STOP)));
    }
}

/// Does `work` that waits for input, maybe for ever, and has begun nothing to be tidied up: a signal ends the program at once.
pub(crate) fn at_once<T>(work: impl FnOnce() -> T) -> T {
    AT_ONCE.store(true, Ordering::Relaxed);
    let done = work();
    AT_ONCE.store(false, Ordering::Relaxed);
    done
}

/// What becomes true with the first signal.
pub(crate) fn flag() -> &'static AtomicBool {
    &STOP
}

/// Whether there is a reason to go on.
pub(crate) fn go_on() -> ControlFlow<()> {
    if STOP.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}
