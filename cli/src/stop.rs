//! Being stopped by Ctrl-C, or by another signal that ends programs.

use std::ffi::c_int;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

use signal_hook::flag;

/// The exit status of what was stopped: as shells have it for SIGINT.
pub(crate) const STOPPED: u8 = 130;

static STOP: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
/// Whether the first signal ends the program.
static AT_ONCE: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// The signals by which people end a program: who sends a second one wants it to end as it is.
#[cfg(unix)]
const BY_PEOPLE: [c_int; 3] = {
    use signal_hook::consts::{SIGINT, SIGQUIT, SIGTERM};
    [SIGINT, SIGTERM, SIGQUIT]
};
#[cfg(not(unix))]
const BY_PEOPLE: [c_int; 2] = [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM];

/// Signals of the system that end a program, except those that tell of a defect: a terminal that is gone, a limit of time, a scheduler. They
/// come more than once: from the system and from the shell, or every second.
#[cfg(unix)]
const BY_SYSTEMS: [c_int; 7] = {
    use signal_hook::consts::{SIGALRM, SIGHUP, SIGPROF, SIGUSR1, SIGUSR2, SIGVTALRM, SIGXCPU};
    [SIGHUP, SIGXCPU, SIGALRM, SIGVTALRM, SIGPROF, SIGUSR1, SIGUSR2]
};
#[cfg(not(unix))]
const BY_SYSTEMS: [c_int; 0] = [];

/// From now on the first signal makes [`go_on`] break, so that what was begun can be tidied up, and a second one of
/// [people](BY_PEOPLE) ends the program as it is.
pub(crate) fn listen() {
    // Where that fails a signal ends the program at once.
    let ends = |signal, when| flag::register_conditional_shutdown(signal, STOPPED.into(), Arc::clone(when));
    for signal in BY_PEOPLE {
        // The order counts: the first signal must find the flag down.
        let _ = ends(signal, &STOP)
            .and_then(|_| ends(signal, &AT_ONCE))
            .and_then(|_| flag::register(signal, Arc::clone(&STOP)));
    }
    for signal in BY_SYSTEMS.into_iter().filter(|signal| !is_held_off(*signal)) {
        let _ = ends(signal, &AT_ONCE).and_then(|_| flag::register(signal, Arc::clone(&STOP)));
    }
}

/// Whether whoever started the program keeps a signal from it, as `nohup` keeps SIGHUP. Where the system does not tell, SIGHUP may be
/// one.
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

/// From now on a file that may not grow further is an error of writing it, and not the end of the program.
pub(crate) fn tell_of_full_files() {
    #[cfg(unix)]
    let _ = flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
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
