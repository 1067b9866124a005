//! Being stopped by Ctrl-C or SIGTERM.

use std::ops::ControlFlow;
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};

/// The exit status of what was stopped: as shells have it for SIGINT.
pub(crate) const STOPPED: u8 = 130;

static STOP: AtomicBool = AtomicBool::new(false);

/// From now on the first signal makes [`go_on`] break, so that what was begun can be tidied up, and the second ends the program
/// as it is.
pub(crate) fn listen() {
    // Where that fails a signal ends the program at once.
    let _ = ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::Relaxed) {
            process::exit(STOPPED.into());
        }
    });
}

/// What becomes true with the first signal.
pub(crate) fn flag() -> &'static AtomicBool {
    &STOP
}

/// Whether there is a reason to go on.
pub(crate) fn go_on() -> ControlFlow<()> {
    if STOP.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}
