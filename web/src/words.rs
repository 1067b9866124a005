//! What the library reports, in the words of the page: each cause with the field that helps.

use mrfgs::Error;
use mrfgs::check::Warning;
use mrfgs::error::{DeviceError, MemoryError, Purpose, RangeError};

/// What is thrown for an error of the library.
pub(crate) fn thrown(error: impl Into<Error>) -> js_sys::Error {
    js_sys::Error::new(&self::error(&error.into()))
}

/// An error with its remedy.
pub(crate) fn error(error: &Error) -> String {
    match error {
        Error::Range(RangeError::Empty { .. }) => {
            format!("{error}: raise the upper end or lower the lower one")
        }
        Error::Range(RangeError::TooManyLabels { .. }) => format!("{error}: narrow the range"),
        Error::Range(RangeError::NotFound) => format!("{error}: give the range"),
        Error::Device(DeviceError::NoDriver) => "this browser shows no GPU: it may lack WebGPU".into(),
        Error::Device(DeviceError::WrongMaps { .. }) => format!("{error}: update its driver, or the browser"),
        Error::Memory(MemoryError::Machine { purpose: Purpose::Match, .. }) => {
            format!(
                "{error}: use a smaller image or a narrower range, or the program in place of the browser"
            )
        }
        Error::Memory(_) => format!("{error}: use a smaller image, or the program in place of the browser"),
        _ => error.to_string(),
    }
}

/// A warning with its remedy.
pub(crate) fn warning(warning: &Warning) -> String {
    match warning {
        Warning::Saturated { .. } => format!("{warning}: expose both alike"),
        Warning::Swapped { .. } => {
            format!(
                "{warning}: exchange the two images, or give a negative lower end if the cameras converge"
            )
        }
        Warning::Clipped { upper: true, .. } => format!("{warning}: raise the upper end of the range"),
        Warning::Clipped { upper: false, .. } => format!("{warning}: lower the lower end of the range"),
        _ => warning.to_string(),
    }
}
