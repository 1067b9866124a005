//! Where a match runs. None of these flags changes the result.

use mrfgs::low_level::backend::gpu;
use mrfgs::options::{DeviceChoice, Execution};
use mrfgs::threads;

use crate::process;

#[derive(clap::Args)]
#[command(next_help_heading = "Where it runs (does not change the result)")]
pub(crate) struct ExecutionArgs {
    /// auto: a GPU if there is one, else the CPU; cpu: the CPU; gpu: the fastest device, or an error if there is none; or a device by its
    /// index in `mrfgs devices` or part of its name
    #[arg(long, default_value = "auto", value_name = "auto|cpu|gpu|NAME|INDEX")]
    device: DeviceChoice,
    #[command(flatten)]
    threads: ThreadArgs,
}

/// The largest number of threads.
const MOST: i64 = Execution::MOST_THREADS as i64;

/// The number of threads of the CPU path.
#[derive(clap::Args)]
pub(crate) struct ThreadArgs {
    /// Maximum number of CPU threads, 1 to 1024 [default: the processors available to the process (affinity, cgroups), or fewer if
    /// `RAYON_NUM_THREADS`, `OMP_NUM_THREADS` or Slurm says so]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=MOST))]
    pub(crate) threads: Option<u16>,
}

impl ThreadArgs {
    /// Limits the threads of this process, including those that read files and check the input.
    pub(crate) fn limit(&self) {
        threads::limit(self.threads.map_or(0, usize::from));
        // Start the threads before the free memory is measured, as a matcher does.
        threads::run(|| ());
    }

    /// The library's settings for `device`, without timings per stage.
    pub(crate) fn execution(&self, device: &DeviceChoice) -> Execution {
        Execution { device: device.clone(), threads: self.threads.map(usize::from), timings: false }
    }
}

impl ExecutionArgs {
    /// The library's settings. Call this before anything else: it may restart the program before it queries drivers.
    pub(crate) fn execution(&self) -> Execution {
        let asks_drivers = match &self.device {
            DeviceChoice::Auto => gpu::may_have_gpu(),
            DeviceChoice::Cpu => false,
            DeviceChoice::Gpu | DeviceChoice::Named(_) => true,
        };
        if asks_drivers {
            process::quiet_loader();
        }
        self.threads.limit();
        self.threads.execution(&self.device)
    }
}
