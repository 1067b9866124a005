//! Standard output and standard error.

use std::io::{self, ErrorKind, IsTerminal, Write};

use mrfgs::error::Reason;
use mrfgs::{Error, Result};

/// Writes text to standard output.
pub(crate) fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    printed(out.write_all(text.as_bytes()).and_then(|()| out.flush()))
}

/// The outcome of writing text to standard output. A reader like `head` that has seen enough is no error.
pub(crate) fn printed(result: io::Result<()>) -> Result<()> {
    match result {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Error::write("standard output", e)),
        _ => check_takes_any(),
    }
}

/// Writes data to standard output, all of a map or a part of a film. A reader that leaves before the end has not the whole,
/// so unlike with text that is a failure.
pub(crate) fn print_data(bytes: &[u8], what: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(bytes).and_then(|()| out.flush()).map_err(|e| match e.kind() {
        ErrorKind::BrokenPipe => {
            Error::write("standard output", format!("its reader left before the end of the {what}"))
        }
        _ => Error::write("standard output", e),
    })
}

/// Refuses to send a map to a terminal, or nowhere.
pub(crate) fn check_takes_data() -> Result<()> {
    if io::stdout().is_terminal() {
        let reason = "is a terminal, which shows no map; redirect it, or give the name of a file";
        return Err(Error::write("standard output", Reason::of_request(reason)));
    }
    check_leads_somewhere()
}

/// Refuses a standard output that is open for reading alone: Rust writes to it without an error.
#[cfg(unix)]
fn check_takes_any() -> Result<()> {
    use rustix::fs::{OFlags, fcntl_getfl};
    match fcntl_getfl(io::stdout()) {
        Ok(flags) if flags & OFlags::RWMODE == OFlags::RDONLY => {
            Err(Error::write("standard output", "is open for reading alone; redirect it"))
        }
        _ => Ok(()),
    }
}

#[cfg(not(unix))]
fn check_takes_any() -> Result<()> {
    Ok(())
}

/// Refuses a standard output into which `-` would send data that nobody gets.
///
/// Before a program begins, Rust opens `/dev/null` for reading and writing in the place of a standard output that is closed. Shells
/// open it for writing alone, and that counts. Other programs may open it as Rust does for whom they start, to get no text; so text
/// may go there, and only what is asked for with `-` may not.
#[cfg(unix)]
pub(crate) fn check_leads_somewhere() -> Result<()> {
    use rustix::fs::{OFlags, fcntl_getfl, fstat, stat};
    check_takes_any()?;
    let is_null = || Ok::<_, io::Error>(fstat(io::stdout())?.st_rdev == stat("/dev/null")?.st_rdev);
    let is_both = fcntl_getfl(io::stdout()).is_ok_and(|flags| flags & OFlags::RWMODE == OFlags::RDWR);
    if is_both && is_null().unwrap_or(false) {
        let reason = "is closed, or leads nowhere; redirect it, or give the name of a file";
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
    // If standard error is closed, there is nobody to tell.
    let _ = writeln!(io::stderr(), "mrfgs: {text}");
}
