//! What the library reports, in the words of Python: each cause with the argument or the option that helps.

use mrfgs::Error;
use mrfgs::check::Warning;
use mrfgs::error::{BudgetError, DeviceError, ExecutionError, MemoryError, Purpose, RangeError};

/// What to do where the device does not serve.
const CPU: &str = "use device=\"cpu\"";

/// An error with its remedy.
pub(crate) fn error(error: &Error) -> String {
    match error {
        Error::Option { key, cause } => format!("options[\"{key}\"]: {cause}"),
        Error::Preset { .. } => format!("preset: {error}"),
        Error::Range(cause) => range(cause),
        Error::Execution(cause @ ExecutionError::NoSuchDevice { .. }) => format!("device: {cause}"),
        Error::Execution(cause) => format!("threads: {cause}"),
        Error::Budget(cause @ BudgetError::NoTileFits { needed, .. }) => {
            format!("options[\"memory\"]: {cause}; give {needed} or more, or a smaller image or range")
        }
        Error::Device(DeviceError::NoDriver) => format!("{error}: install the driver of the GPU, or {CPU}"),
        Error::Device(DeviceError::WrongMaps { .. }) => format!("{error}: update its driver, or {CPU}"),
        Error::Device(DeviceError::Failed { .. }) => format!("{error}; use another device, or {CPU}"),
        Error::Device(_) => format!("{error}: {CPU}"),
        Error::Memory(cause) => memory(cause),
        _ => error.to_string(),
    }
}

/// An error of what the calibration of the files `names` says; `None` for other errors.
pub(crate) fn calibration(error: &Error, names: &str) -> Option<String> {
    match error {
        Error::Calibration(_) => Some(format!("{names}: {error}")),
        Error::Mismatch(cause) => Some(format!("{names}: {cause}; size is (width, height)")),
        _ => None,
    }
}

fn range(cause: &RangeError) -> String {
    match cause {
        RangeError::Empty { .. } => format!("max_disparity: {cause}: raise it or lower min_disparity"),
        RangeError::TooFar { disparity, .. } if *disparity < 0 => format!("min_disparity: {cause}"),
        RangeError::TooManyLabels { .. } => format!("max_disparity: {cause}: narrow the range"),
        RangeError::NotFound => {
            format!("max_disparity: {cause}: give the largest disparity to search, in pixels")
        }
        _ => format!("max_disparity: {cause}"),
    }
}

fn memory(cause: &MemoryError) -> String {
    match cause {
        MemoryError::Machine { purpose: Purpose::Match, .. } => {
            format!(
                "{cause}: lower options[\"memory\"], or use a smaller image, a narrower range (min_disparity, max_disparity) \
                 or fewer neighbours (a higher options[\"percentile\"])"
            )
        }
        MemoryError::Machine { .. } => format!("{cause}: use a smaller image, or a part of it"),
        _ => format!("{cause}: {CPU}, or a smaller image or range"),
    }
}

/// A warning with its remedy.
pub(crate) fn warning(warning: &Warning) -> String {
    match warning {
        Warning::Saturated { .. } => {
            format!("{warning}: expose both alike, or give a mask of what is no image")
        }
        Warning::Swapped { .. } => {
            format!(
                "{warning}: exchange the two images, or give a negative min_disparity if the cameras converge"
            )
        }
        Warning::Clipped { upper: true, .. } => format!("{warning}: raise max_disparity"),
        Warning::Clipped { upper: false, .. } => format!("{warning}: lower min_disparity"),
        _ => warning.to_string(),
    }
}
