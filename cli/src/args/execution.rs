//! Where a match runs. No choice changes a bit of the result.

use std::convert::Infallible;
use std::fmt;
use std::str::FromStr;

use mrfgs::low_level::backend::gpu;
use mrfgs::options::{DeviceChoice, Execution};

/// Where a match runs.
#[derive(clap::Args)]
#[command(next_help_heading = "Where it runs (changes no bit of the result)")]
pub(crate) struct ExecutionArgs {
    /// auto: a GPU if there is one, else the CPU; cpu: the CPU; gpu: the fastest device, or an error if there
    /// is none; or a device by its index in `mrfgs devices` or a part of its name
    #[arg(long, default_value_t, value_name = "auto|cpu|gpu|NAME|INDEX")]
    pub(crate) device: Device,
    #[command(flatten)]
    pub(crate) threads: ThreadArgs,
}

/// How many threads the CPU path has.
#[derive(clap::Args)]
pub(crate) struct ThreadArgs {
    /// Threads of the CPU path, 1 to 1024 [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
}

/// What runs the stages, as the user gives it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Device(pub(crate) DeviceChoice);

impl FromStr for Device {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(Self(text.into()))
    }
}

impl fmt::Display for Device {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match &self.0 {
            DeviceChoice::Auto => "auto",
            DeviceChoice::Cpu => "cpu",
            DeviceChoice::Gpu => "gpu",
            DeviceChoice::Named(name) => name,
        })
    }
}

impl Device {
    /// Whether the drivers are asked which devices there are.
    pub(crate) fn asks_drivers(&self) -> bool {
        match &self.0 {
            DeviceChoice::Auto => gpu::may_have_gpu(),
            DeviceChoice::Cpu => false,
            DeviceChoice::Gpu | DeviceChoice::Named(_) => true,
        }
    }

    /// How the library takes it; the time of stages is not taken.
    pub(crate) fn execution(&self, threads: &ThreadArgs) -> Execution {
        Execution { device: self.0.clone(), threads: threads.threads.map(usize::from), timings: false }
    }

    /// The index or name of a certain device.
    pub(crate) fn name(&self) -> Option<&str> {
        match &self.0 {
            DeviceChoice::Named(name) => Some(name),
            _ => None,
        }
    }
}

impl ExecutionArgs {
    pub(crate) fn execution(&self) -> Execution {
        if let Some(threads) = self.threads.threads {
            // It also bounds what is done around a match: reading, and the search for what may be wrong. A second call
            // changes nothing.
            let _ = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global();
        }
        self.device.execution(&self.threads)
    }
}
