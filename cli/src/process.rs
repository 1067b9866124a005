//! This process: what it has used of its machine, how it tells of its own defects, and its environment.

use std::io::Write;
use std::time::Duration;
use std::{env, io, panic};

use mrfgs::image::read;

use crate::text::single_line;

/// From now on a panic is one line on standard error, and none where an image is decoded, as that becomes an error of the file.
/// With `RUST_BACKTRACE` it is what it always is.
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
        let text = single_line(&format!("this is a defect of mrfgs, please report it: {text}{place}"));
        let _ = writeln!(io::stderr(), "mrfgs: {text}");
    }));
}

/// Keeps the loader of Vulkan from printing to standard error that `XDG_RUNTIME_DIR` is missing, as it does on machines without a
/// display: starts the program anew with that set, as no other way to set it is safe.
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
    // A folder that nobody else can put a socket into. It returns where it fails, and then there is a line too many.
    let _ = command.args(args).env("XDG_RUNTIME_DIR", "/").exec();
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn quiet_loader() {}

/// The time that all processors together have spent on this process.
#[cfg(unix)]
pub(crate) fn processor_time() -> Option<Duration> {
    Duration::try_from(rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime)).ok()
}

/// The time that all processors together have spent on this process.
#[cfg(not(unix))]
pub(crate) fn processor_time() -> Option<Duration> {
    None
}

/// The most memory that this process has held so far, in bytes.
pub(crate) fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok().map(|kib| kib << 10)
}
