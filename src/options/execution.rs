//! Where and how a match runs.

use crate::threads;
use std::convert::Infallible;
use std::str::FromStr;

/// Where and how a match runs; this does not change the maps.
#[derive(Clone, Debug, Default)]
pub struct Execution {
    /// The device that runs the stages.
    pub device: DeviceChoice,
    /// Threads of the CPU path, 1 to [`Execution::MOST_THREADS`]; `None` takes the [usual](threads::usual)
    /// number. Four per processor, and beyond eight one per 1024 pixels of a pair, are the limit: more would
    /// only wait.
    pub threads: Option<usize>,
    /// Whether to measure the time of every stage.
    pub timings: bool,
}

impl Execution {
    /// The largest number of threads: more than any match can use, and few enough for every system.
    pub const MOST_THREADS: usize = threads::MOST;
}

/// The choice of the device that runs a match.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// A discrete GPU, else an integrated one, else the CPU path, which also replaces a GPU that fails.
    #[default]
    Auto,
    /// The CPU path.
    Cpu,
    /// The GPU that `Auto` prefers, else a software driver of Vulkan or Metal; an error if there is none.
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

    /// Like [`DeviceChoice::from`].
    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(text.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_other_text_is_a_name() {
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
