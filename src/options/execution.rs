//! Where and how a match runs.

use crate::threads;
use std::convert::Infallible;
use std::str::FromStr;

/// Where and how a match runs; nothing here changes a bit of the result.
#[derive(Clone, Debug, Default)]
pub struct Execution {
    /// What runs the stages.
    pub device: DeviceChoice,
    /// Threads of the CPU path, 1 to [`Execution::MOST_THREADS`]; `None` takes the [usual](threads::usual) number. There are
    /// no more than four for each processor, and of more than eight no more than one for each 1024 pixels of a pair: others would only
    /// wait.
    pub threads: Option<usize>,
    /// Whether to measure the time of every stage.
    pub timings: bool,
}

impl Execution {
    /// The largest number of threads: more than any match can share, and few enough for every system.
    pub const MOST_THREADS: usize = threads::MOST;
}

/// What runs the stages of a match.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// A discrete GPU, else an integrated one, else the CPU path. The CPU path also steps in where the GPU fails.
    #[default]
    Auto,
    /// The CPU path.
    Cpu,
    /// The GPU that `Auto` prefers, else a software driver of Vulkan or Metal; an error where there is none.
    Gpu,
    /// The GPU or driver with this index in the list of devices, or with this text in its name.
    Named(String),
}

impl From<&str> for DeviceChoice {
    /// `auto`, `cpu`, `gpu`; any other text is a name or an index.
    fn from(text: &str) -> Self {
        match text {
            "auto" => Self::Auto,
            "cpu" => Self::Cpu,
            "gpu" => Self::Gpu,
            name => Self::Named(name.to_owned()),
        }
    }
}

impl FromStr for DeviceChoice {
    type Err = Infallible;

    /// As [`DeviceChoice::from`].
    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(text.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_word_is_a_name() {
        for (text, device) in [
            ("auto", DeviceChoice::Auto),
            ("cpu", DeviceChoice::Cpu),
            ("gpu", DeviceChoice::Gpu),
            ("0", DeviceChoice::Named("0".into())),
            ("llvmpipe", DeviceChoice::Named("llvmpipe".into())),
        ] {
            assert_eq!(text.parse(), Ok(device));
        }
    }
}
