//! How a call ends, and what is said of it: no panic leaves the library.

use std::ffi::c_char;
use std::panic::{AssertUnwindSafe, catch_unwind};

use mrfgs::Error;

use crate::text::Said;
use crate::words;

/// How a call ended.
#[repr(C)]
#[derive(Clone, Copy)]
pub enum Status {
    /// It did what it should.
    Ok = 0,
    /// An argument makes no sense, or arguments do not fit each other.
    Argument = 1,
    /// A file cannot be read.
    File = 2,
    /// There is no device, or the one that there is failed.
    Device = 3,
    /// The machine or the device has not enough memory.
    Memory = 4,
    /// mrfgs_matcher_stop() ended the match.
    Stopped = 5,
    /// The library is at fault. Please report it.
    Defect = 6,
}

/// Why a call failed.
pub(crate) struct Failure {
    status: Status,
    text: String,
}

impl Failure {
    /// For an argument that the library never sees.
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

/// What was wrong with the last call of this thread that failed; "" where none has. It stays until the next call of this thread that
/// fails.
#[unsafe(no_mangle)]
pub extern "C" fn mrfgs_last_error() -> *const c_char {
    LAST.with(Said::text)
}

/// Does what a function of the header does, and turns what goes wrong into a status.
pub(crate) fn call(body: impl FnOnce() -> Result<(), Failure>) -> Status {
    let failure = match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(())) => return Status::Ok,
        Ok(Err(failure)) => failure,
        Err(_) => Failure {
            status: Status::Defect,
            text: "the library panicked, which is a defect of mrfgs".into(),
        },
    };
    LAST.with(|last| last.say(&failure.text));
    failure.status
}
