//! Standard output and standard error.

use std::io::{self, ErrorKind, IsTerminal, Write};

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
        _ => Ok(()),
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

/// Refuses to send a map to a terminal.
pub(crate) fn check_takes_data() -> Result<()> {
    if io::stdout().is_terminal() {
        let reason = "is a terminal, which shows no map; redirect it, or give the name of a file";
        return Err(Error::write("standard output", reason));
    }
    Ok(())
}

/// Writes a message to standard error.
pub(crate) fn say(text: &str) {
    // If standard error is closed, there is nobody to tell.
    let _ = writeln!(io::stderr(), "mrfgs: {text}");
}
