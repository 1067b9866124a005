//! The status of calls and their errors; no panic leaves the library.

use std::ffi::c_char;
use std::panic::{AssertUnwindSafe, catch_unwind};

use mrfgs::Error;

use crate::text::Said;
use crate::words;

/// The result of a call.
#[repr(C)]
#[derive(Clone, Copy)]
pub enum Status {
    /// The call succeeded.
    Ok = 0,
    /// An argument is invalid, or arguments are inconsistent.
    Argument = 1,
    /// A file cannot be read.
    File = 2,
    /// There is no device, or it failed.
    Device = 3,
    /// The machine or the device has too little memory.
    Memory = 4,
    /// mrfgs_matcher_stop() stopped the match.
    Stopped = 5,
    /// A bug in the library. Please report it.
    Defect = 6,
}

/// Why a call failed.
pub(crate) struct Failure {
    status: Status,
    text: String,
}

impl Failure {
    /// For an argument refused before the library sees it.
    pub(crate) fn argument(text: impl Into<String>) -> Self {
        Self { status: Status::Argument, text: text.into() }
    }

    pub(crate) fn memory(text: impl Into<String>) -> Self {
        Self { status: Status::Memory, text: text.into() }
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let status = match error {
            Error::Read { .. } | Error::Write { .. } => Status::File,
            Error::Device(_) => Status::Device,
            Error::Memory(_) => Status::Memory,
            Error::Interrupted => Status::Stopped,
            _ => Status::Argument,
        };
        Self { status, text: words::error(&error) }
    }
}

thread_local! {
    static LAST: Said = const { Said::nothing() };
}

/// The error of this thread's last failed call; "" without any. Valid until this thread's next failed call.
#[unsafe(no_mangle)]
pub extern "C" fn mrfgs_last_error() -> *const c_char {
    LAST.with(Said::text)
}

/// Runs the body of an exported function, and turns errors and panics into a status.
pub(crate) fn call(body: impl FnOnce() -> Result<(), Failure>) -> Status {
    let failure = match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(())) => return Status::Ok,
        Ok(Err(failure)) => failure,
        Err(_) => {
            Failure { status: Status::Defect, text: "the library panicked, which is a bug in mrfgs".into() }
        }
    };
    LAST.with(|last| last.say(&failure.text));
    failure.status
}
