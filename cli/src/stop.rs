//! Stopping on Ctrl-C or another signal that ends programs.

use std::ffi::c_int;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

use signal_hook::flag;

/// The exit status after a stop: the shell's status for SIGINT.
pub(crate) const STOPPED: u8 = 130;

static STOP: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
/// Whether the first signal ends the program at once.
static AT_ONCE: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Signals sent by a person, whose second one ends the program at once.
#[cfg(unix)]
const BY_PEOPLE: [c_int; 3] = {
    use signal_hook::consts::{SIGINT, SIGQUIT, SIGTERM};
    [SIGINT, SIGTERM, SIGQUIT]
};
#[cfg(not(unix))]
const BY_PEOPLE: [c_int; 2] = [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM];

/// Other signals that end a program, except those of crashes: a closed terminal, a time limit, a scheduler. They may arrive more than once,
/// from the system and the shell or every second.
#[cfg(unix)]
const BY_SYSTEMS: [c_int; 7] = {
    use signal_hook::consts::{SIGALRM, SIGHUP, SIGPROF, SIGUSR1, SIGUSR2, SIGVTALRM, SIGXCPU};
    [SIGHUP, SIGXCPU, SIGALRM, SIGVTALRM, SIGPROF, SIGUSR1, SIGUSR2]
};
#[cfg(not(unix))]
const BY_SYSTEMS: [c_int; 0] = [];

/// Installs the handlers: the first signal makes [`go_on`] break so that the program cleans up, and a second one [by a person](BY_PEOPLE)
/// ends it at once.
pub(crate) fn listen() {
    // If this fails, a signal ends the program at once.
    let ends = |signal, when| flag::register_conditional_shutdown(signal, STOPPED.into(), Arc::clone(when));
    for signal in BY_PEOPLE {
        // The order matters: the first signal must find the flag down.
        let _ = ends(signal, &STOP)
            .and_then(|_| ends(signal, &AT_ONCE))
            .and_then(|_| flag::register(signal, Arc::clone(&STOP)));
    }
    for signal in BY_SYSTEMS.into_iter().filter(|signal| !is_held_off(*signal)) {
        let _ = ends(signal, &AT_ONCE).and_then(|_| flag::register(signal, Arc::clone(&STOP)));
    }
}

/// Whether the parent process ignores a signal for this program, as `nohup` does with SIGHUP. If the system does not tell, assume so for
/// SIGHUP.
#[cfg(unix)]
fn is_held_off(signal: c_int) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|digits| u64::from_str_radix(digits.trim(), 16).ok());
    ignored.map_or(signal == signal_hook::consts::SIGHUP, |ignored| ignored >> (signal - 1) & 1 == 1)
}

#[cfg(not(unix))]
fn is_held_off(_: c_int) -> bool {
    false
}

/// Turns a file size limit (SIGXFSZ) into a write error instead of the end of the program.
pub(crate) fn tell_of_full_files() {
    #[cfg(unix)]
    let _ = flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
}

/// Runs `work`, which may wait for input forever and leaves nothing to clean up: a signal ends the program at once.
pub(crate) fn at_once<T>(work: impl FnOnce() -> T) -> T {
    AT_ONCE.store(true, Ordering::Relaxed);
    let done = work();
    AT_ONCE.store(false, Ordering::Relaxed);
    done
}

/// Becomes true with the first signal.
pub(crate) fn flag() -> &'static AtomicBool {
    &STOP
}

/// Breaks once a signal has arrived.
pub(crate) fn go_on() -> ControlFlow<()> {
    if STOP.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}
