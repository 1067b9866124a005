//! Why the program ends early, and the message it prints.

use std::fmt;
use std::path::Path;
use std::process::ExitCode;

use mrfgs::Error;
use mrfgs::error::RangeError;

use crate::remedy;
use crate::stop;
use crate::text::single_line;

/// A result of the program.
pub(crate) type Result<T, E = Failure> = std::result::Result<T, E>;

/// Why the program ends early.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The command line makes no sense.
    Usage(String),
    /// A failure without an error of the library, such as some failed pairs of a batch.
    Failed(String),
    /// The user stopped it.
    Stopped(String),
    /// An error of the library.
    Error(Error),
}

impl Failure {
    /// An error of the flag or argument `what`, with its reason.
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

    /// The message in one line, with remedies in the vocabulary `words`.
    pub(crate) fn message(&self, words: &remedy::Vocabulary) -> String {
        match self {
            Self::Usage(text) | Self::Failed(text) | Self::Stopped(text) => single_line(text),
            Self::Error(error) => single_line(&remedy::error(error, words)),
        }
    }
}

impl fmt::Display for Failure {
    /// One line, even if a file name contains line breaks.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.message(&remedy::FLAGS))
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        match error {
            Error::Interrupted => Self::Stopped("stopped; no output was left behind".into()),
            error => Self::Error(error),
        }
    }
}

/// Turns an error about a value into one about the file `path` that holds it; `what` names the entry.
pub(crate) fn in_file(error: Error, path: &Path, what: &str) -> Error {
    match error {
        Error::Range(cause) => Error::read(path, format!("{what}{cause}")),
        Error::Calibration(reason) => Error::read(path, format!("{what}{reason}")),
        error => error,
    }
}

/// Makes an error about a temporary file name the final `path`.
pub(crate) fn at(error: Error, path: &Path) -> Error {
    match error {
        Error::Write { reason, .. } => Error::write(path, reason),
        error => error,
    }
}
