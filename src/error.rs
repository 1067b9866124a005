//! The one error type. Every message names the thing that failed and the way out.

use std::path::{Path, PathBuf};

/// What can go wrong, in words that a user can act on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be read, or is not what its name says.
    #[error("cannot read {}: {reason}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, and the remedy where there is one.
        reason: String,
    },
    /// A file could not be written; nothing of it is left behind.
    #[error("cannot write {}: {reason}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What went wrong, and the remedy where there is one.
        reason: String,
    },
    /// An option, a flag or an argument has a value that makes no sense.
    #[error("{name}: {reason}")]
    Option {
        /// The option's key or the flag, as the user wrote it.
        name: String,
        /// What is wrong with the value, and what would be right.
        reason: String,
    },
    /// Images, masks or maps that belong together do not fit each other.
    #[error("{0}")]
    Mismatch(String),
    /// No device, or one that cannot do the job, or one that failed.
    #[error("{0}")]
    Device(String),
    /// The job needs more memory than it was given.
    #[error("{0}")]
    Memory(String),
    /// The caller's progress callback asked to stop.
    #[error("interrupted")]
    Interrupted,
}

/// Shorthand for results of this crate.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An [`Error::Read`] for `path`.
    pub fn read(path: impl AsRef<Path>, reason: impl ToString) -> Self {
        Self::Read { path: path.as_ref().to_owned(), reason: reason.to_string() }
    }

    /// An [`Error::Write`] for `path`.
    pub fn write(path: impl AsRef<Path>, reason: impl ToString) -> Self {
        Self::Write { path: path.as_ref().to_owned(), reason: reason.to_string() }
    }

    /// An [`Error::Option`] for the option or flag `name`.
    pub fn option(name: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Option { name: name.into(), reason: reason.into() }
    }
}
