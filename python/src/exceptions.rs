//! Exceptions and warnings for Python.

use std::error::Error as _;
use std::ffi::CString;
use std::io;

use mrfgs::Error;
use mrfgs::check::Warning;
use mrfgs::error::{ExecutionError, ReadError};
use pyo3::exceptions::{
    PyException, PyFileNotFoundError, PyKeyboardInterrupt, PyMemoryError, PyOSError, PyRuntimeError,
    PyUserWarning, PyValueError,
};
use pyo3::prelude::*;

use crate::words;

pyo3::create_exception!(
    mrfgs,
    MatchWarning,
    PyUserWarning,
    "A probable fault of a pair or of the disparity range, and its remedy."
);

/// Converts an error to an exception, with remedies for Python.
pub(crate) fn exception(error: Error) -> PyErr {
    let text = words::error(&error);
    match error {
        Error::Memory(_) => PyMemoryError::new_err(text),
        Error::Device(_) | Error::Execution(ExecutionError::Forked) => PyRuntimeError::new_err(text),
        Error::Read { cause: ReadError::Other(reason), .. } if is_missing(reason.source()) => {
            PyFileNotFoundError::new_err(text)
        }
        Error::Write { .. } => PyOSError::new_err(text),
        Error::Interrupted => PyKeyboardInterrupt::new_err(()),
        _ => PyValueError::new_err(text),
    }
}

/// Raises `instead` of an exception, with that as its cause, but lets Ctrl-C and the like through, which may come at any time.
pub(crate) fn instead(py: Python, error: PyErr, instead: PyErr) -> PyErr {
    if !error.is_instance_of::<PyException>(py) {
        return error;
    }
    instead.set_cause(py, Some(error));
    instead
}

/// Whether the system reports that a file does not exist.
fn is_missing(cause: Option<&(dyn std::error::Error + 'static)>) -> bool {
    let of_system = cause.and_then(|cause| cause.downcast_ref::<io::Error>());
    of_system.is_some_and(|error| error.kind() == io::ErrorKind::NotFound)
}

/// Issues warnings at the calling line of Python.
pub(crate) fn warn(py: Python, warnings: impl IntoIterator<Item = Warning>) -> PyResult<()> {
    tell(py, warnings.into_iter().map(|warning| words::warning(&warning)))
}

/// Issues these lines as warnings.
pub(crate) fn tell(py: Python, lines: impl IntoIterator<Item = String>) -> PyResult<()> {
    for line in lines {
        let text = CString::new(line)?;
        PyErr::warn(py, &py.get_type::<MatchWarning>(), &text, 1)?;
    }
    Ok(())
}
