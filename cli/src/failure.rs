//! Why the program ends early, and in which words.

use std::fmt;
use std::path::Path;
use std::process::ExitCode;

use mrfgs::Error;
use mrfgs::error::RangeError;

use crate::remedy;
use crate::stop;
use crate::text::single_line;

/// Shorthand for results of the program.
pub(crate) type Result<T, E = Failure> = std::result::Result<T, E>;

/// Why the program ends early.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The command line makes no sense.
    Usage(String),
    /// Something failed that the library has no error for, such as some pairs of a batch.
    Failed(String),
    /// The user stopped it.
    Stopped(String),
    /// An error of the library.
    Error(Error),
}

impl Failure {
    /// A flag or argument that makes no sense, and why.
    pub(crate) fn usage(what: impl fmt::Display, reason: impl fmt::Display) -> Self {
        Self::Usage(format!("{what}: {reason}"))
    }

    pub(crate) fn exit_code(&self) -> ExitCode {
        match self {
            Self::Error(Error::Range(RangeError::NotFound { .. } | RangeError::NotRectified)) => {
                ExitCode::FAILURE
            }
            Self::Usage(_)
            | Self::Error(
                Error::Option { .. }
                | Error::Preset { .. }
                | Error::Range(_)
                | Error::Execution(_)
                | Error::Budget(_),
            ) => ExitCode::from(2),
            Self::Error(Error::Write { reason, .. }) if reason.is_of_request() => ExitCode::from(2),
            Self::Stopped(_) => ExitCode::from(stop::STOPPED),
            Self::Failed(_) | Self::Error(_) => ExitCode::FAILURE,
        }
    }

    /// In one line, with what helps in these `words`.
    pub(crate) fn message(&self, words: &remedy::Vocabulary) -> String {
        match self {
            Self::Usage(text) | Self::Failed(text) | Self::Stopped(text) => single_line(text),
            Self::Error(error) => single_line(&remedy::error(error, words)),
        }
    }
}

impl fmt::Display for Failure {
    /// One line, whatever the names of files hold.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.message(&remedy::FLAGS))
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        match error {
            Error::Interrupted => Self::Stopped("stopped; nothing is left behind".into()),
            error => Self::Error(error),
        }
    }
}

/// An error of a value that the file `path` holds: it names the file, and `what` in it.
pub(crate) fn in_file(error: Error, path: &Path, what: &str) -> Error {
    match error {
        Error::Range(cause) => Error::read(path, format!("{what}{cause}")),
        Error::Calibration(reason) => Error::read(path, format!("{what}{reason}")),
        error => error,
    }
}

/// An error of writing a file in the making that names `path`, where the user expects the file.
pub(crate) fn at(error: Error, path: &Path) -> Error {
    match error {
        Error::Write { reason, .. } => Error::write(path, reason),
        error => error,
    }
}
