//! Why the program ends early, and every place that turns an error of the library into words for the command line.

use std::fmt;
use std::path::Path;
use std::process::ExitCode;

use mrfgs::Error;

use crate::stop;
use crate::text::single_line;

/// Why the program ends early.
pub(crate) enum Failure {
    /// The command line makes no sense.
    Usage(String),
    /// Some pairs of a batch failed.
    Incomplete(String),
    /// The user stopped it.
    Stopped(String),
    /// Anything else.
    Error(Error),
}

impl Failure {
    pub(crate) fn exit_code(&self) -> ExitCode {
        match self {
            Self::Usage(_) | Self::Error(Error::Option { .. }) => ExitCode::from(2),
            Self::Stopped(_) => ExitCode::from(stop::STOPPED),
            Self::Incomplete(_) | Self::Error(_) => ExitCode::FAILURE,
        }
    }
}

impl fmt::Display for Failure {
    /// One line, whatever the names of files hold.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Usage(text) | Self::Incomplete(text) | Self::Stopped(text) => {
                f.write_str(&single_line(text))
            }
            Self::Error(error) => f.write_str(&message(error)),
        }
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

/// What the library calls something, and what the command line calls it.
const NAMES: [(&str, &str); 3] =
    [("--backend cpu", "--device cpu"), ("--intermediates: shows", "DIR: shows"), ("--preset", "--method")];

/// An error in one line.
pub(crate) fn message(error: &Error) -> String {
    in_flags(&error.to_string())
}

/// A text of the library in one line, with the flags of the program.
pub(crate) fn in_flags(text: &str) -> String {
    let text = single_line(text);
    NAMES.iter().fold(text, |text, (library, program)| text.replace(library, program))
}

/// An error of the range that names the columns of a list instead of flags.
pub(crate) fn in_columns(error: Error) -> Error {
    match error {
        Error::Option { name, reason } => Error::Option {
            name: name.trim_start_matches("--").replace('-', "_"),
            reason: reason.replace("--min-disparity", "min_disparity"),
        },
        Error::Mismatch(reason) => Error::Mismatch(reason.replace("--max-disparity", "max_disparity")),
        error => error,
    }
}

/// An error of a value that the file `path` holds: it names the file, and `what` in it.
pub(crate) fn in_file(error: Error, path: &Path, what: &str) -> Error {
    match error {
        Error::Option { reason, .. } => Error::read(path, format!("{what}{reason}")),
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
