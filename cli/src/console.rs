//! Standard output and standard error.

use std::io::{self, ErrorKind, IsTerminal, Write};

use mrfgs::error::Reason;
use mrfgs::{Error, Result};

/// Writes text to standard output.
pub(crate) fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    printed(out.write_all(text.as_bytes()).and_then(|()| out.flush()))
}

/// Handles the result of writing text to standard output. A closed pipe, as with `head`, is no error.
pub(crate) fn printed(result: io::Result<()>) -> Result<()> {
    match result {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Error::write("standard output", e)),
        _ => check_takes_any(),
    }
}

/// Writes data to standard output: a whole map or part of a film. Unlike with text, a closed pipe is an error, as the reader misses the
/// rest.
pub(crate) fn print_data(bytes: &[u8], what: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(bytes).and_then(|()| out.flush()).map_err(|e| match e.kind() {
        ErrorKind::BrokenPipe => {
            Error::write("standard output", format!("the reader closed it before the end of the {what}"))
        }
        _ => Error::write("standard output", e),
    })
}

/// Refuses to send a map to a terminal or to nowhere.
pub(crate) fn check_takes_data() -> Result<()> {
    if io::stdout().is_terminal() {
        let reason = "is a terminal; redirect it, or give a file name";
        return Err(Error::write("standard output", Reason::of_request(reason)));
    }
    check_leads_somewhere()
}

/// Refuses a standard output opened read-only: Rust writes to it without an error.
#[cfg(unix)]
fn check_takes_any() -> Result<()> {
    use rustix::fs::{OFlags, fcntl_getfl};
    match fcntl_getfl(io::stdout()) {
        Ok(flags) if flags & OFlags::RWMODE == OFlags::RDONLY => {
            Err(Error::write("standard output", "is opened read-only; redirect it"))
        }
        _ => Ok(()),
    }
}

#[cfg(not(unix))]
fn check_takes_any() -> Result<()> {
    Ok(())
}

/// Refuses to send data (`-`) to a standard output that discards it.
///
/// If standard output is closed, Rust opens `/dev/null` for reading and writing at startup. Shells open it write-only, which is allowed as
/// intended. Parents may also pass it read-write to discard text, so only data is refused.
#[cfg(unix)]
pub(crate) fn check_leads_somewhere() -> Result<()> {
    use rustix::fs::{OFlags, fcntl_getfl, fstat, stat};
    check_takes_any()?;
    let is_null = || Ok::<_, io::Error>(fstat(io::stdout())?.st_rdev == stat("/dev/null")?.st_rdev);
    let is_both = fcntl_getfl(io::stdout()).is_ok_and(|flags| flags & OFlags::RWMODE == OFlags::RDWR);
    if is_both && is_null().unwrap_or(false) {
        let reason = "is closed or discarded; redirect it, or give a file name";
        return Err(Error::write("standard output", reason));
    }
    Ok(())
}

#[cfg(not(unix))]
pub(crate) fn check_leads_somewhere() -> Result<()> {
    Ok(())
}

/// Writes a message to standard error.
pub(crate) fn say(text: &str) {
    // A closed standard error leaves nowhere to report this.
    let _ = writeln!(io::stderr(), "mrfgs: {text}");
}
