//! Small text files: calibrations, config files, lists.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;

use crate::error::{Error, Result};

/// Reads a whole file of at most `most` bytes; `what` says what it should be: "config file".
///
/// # Errors
/// [`Error::Read`] when it cannot be read or is larger.
pub(crate) fn read(path: &Path, most: u64, what: &str) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path).and_then(|file| file.take(most + 1).read_to_end(&mut bytes)).map_err(|e| {
        match e.kind() {
            ErrorKind::NotFound => Error::read(path, "there is no such file; check the name"),
            _ => Error::read(path, e),
        }
    })?;
    if bytes.len() as u64 > most {
        return Err(Error::read(path, format!("larger than any {what}; is it one?")));
    }
    Ok(bytes)
}
