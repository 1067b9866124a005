//! What the library reports, in the words of C: each cause with the call or the option that helps.

use mrfgs::Error;
use mrfgs::check::Warning;
use mrfgs::error::{BudgetError, DeviceError, ExecutionError, MemoryError, Purpose, RangeError};

/// What to do where the device does not serve.
const CPU: &str = "set mrfgs_options_device(options, \"cpu\")";

/// An error with its remedy.
pub(crate) fn error(error: &Error) -> String {
    match error {
        Error::Option { key, cause } => format!("option \"{key}\": {cause}"),
        Error::Preset { .. } => format!("preset: {error}"),
        Error::Range(cause) => range(cause),
        Error::Execution(cause @ ExecutionError::NoSuchDevice { .. }) => format!("device: {cause}"),
        Error::Execution(cause) => format!("threads: {cause}"),
        Error::Budget(cause @ BudgetError::NoTileFits { needed, .. }) => {
            format!("option \"memory\": {cause}; give {needed} or more, or a smaller image or range")
        }
        Error::Device(DeviceError::NoDriver) => format!("{error}: install the driver of the GPU, or {CPU}"),
        Error::Device(DeviceError::WrongMaps { .. }) => format!("{error}: update its driver, or {CPU}"),
        Error::Device(DeviceError::Failed { .. }) => format!("{error}; use another device, or {CPU}"),
        Error::Device(_) => format!("{error}: {CPU}"),
        Error::Memory(cause) => memory(cause),
        _ => error.to_string(),
    }
}

/// A warning with its remedy.
pub(crate) fn warning(warning: &Warning) -> String {
    match warning {
        Warning::Saturated { .. } => {
            format!("{warning}: expose both alike, or give alpha 0 to what is no image")
        }
        Warning::Swapped { .. } => {
            format!(
                "{warning}: exchange the two images, or give a negative range.min if the cameras converge"
            )
        }
        Warning::Clipped { upper: true, .. } => format!("{warning}: raise range.max"),
        Warning::Clipped { upper: false, .. } => format!("{warning}: lower range.min"),
        _ => warning.to_string(),
    }
}

fn range(cause: &RangeError) -> String {
    match cause {
        RangeError::Empty { .. } => format!("range: {cause}: raise range.max or lower range.min"),
        RangeError::TooManyLabels { .. } => format!("range: {cause}: narrow it"),
        RangeError::NotFound => format!("range: {cause}: give one"),
        _ => format!("range: {cause}"),
    }
}

fn memory(cause: &MemoryError) -> String {
    match cause {
        MemoryError::Machine { purpose: Purpose::Match, .. } => format!(
            "{cause}: lower the option \"memory\", or use a smaller image, a narrower range or fewer neighbours (a higher \
             option \"percentile\")"
        ),
        MemoryError::Machine { .. } => format!("{cause}: use a smaller image, or a part of it"),
        _ => format!("{cause}: {CPU}, or use a smaller image or range"),
    }
}
