//! This process: its resource usage, its environment and how it reports panics.

use std::io::Write;
use std::time::Duration;
use std::{env, io, panic};

use mrfgs::image::read;

use crate::text::single_line;

/// Makes a panic print one line to standard error; panics of image decoders print nothing, as they become read errors. With
/// `RUST_BACKTRACE`, panics are reported as usual.
pub(crate) fn tell_panics_in_one_line() {
    if env::var_os("RUST_BACKTRACE").is_some_and(|value| value != "0") {
        return;
    }
    panic::set_hook(Box::new(|panic| {
        if read::is_guarded() {
            return;
        }
        let payload = panic.payload();
        let text = payload.downcast_ref::<&str>().copied();
        let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("a panic");
        let place =
            panic.location().map(|place| format!(" ({}:{})", place.file(), place.line())).unwrap_or_default();
        let text = single_line(&format!("this is a bug in mrfgs, please report it: {text}{place}"));
        let _ = writeln!(io::stderr(), "mrfgs: {text}");
    }));
}

/// Restarts the program with `XDG_RUNTIME_DIR` set, as the Vulkan loader complains on standard error without it (machines without a
/// display). Setting the variable in a running process would not be thread-safe.
#[cfg(target_os = "linux")]
pub(crate) fn quiet_loader() {
    use std::os::unix::process::CommandExt;
    if env::var_os("XDG_RUNTIME_DIR").is_some_and(|folder| !folder.is_empty()) {
        return;
    }
    let Ok(program) = env::current_exe() else { return };
    let mut args = env::args_os();
    let mut command = std::process::Command::new(program);
    if let Some(name) = args.next() {
        command.arg0(name);
    }
    // No one else can put a socket into `/`. If `exec` fails it returns, and the loader prints its line.
    let _ = command.args(args).env("XDG_RUNTIME_DIR", "/").exec();
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn quiet_loader() {}

/// The CPU time of this process, summed over all processors.
#[cfg(unix)]
pub(crate) fn processor_time() -> Option<Duration> {
    Duration::try_from(rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime)).ok()
}

/// The CPU time of this process, summed over all processors.
#[cfg(not(unix))]
pub(crate) fn processor_time() -> Option<Duration> {
    None
}

/// The peak memory of this process, in bytes.
pub(crate) fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok().map(|kib| kib << 10)
}
