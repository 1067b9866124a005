//! Where a match runs. No choice changes a bit of the result.

use mrfgs::low_level::backend::gpu;
use mrfgs::options::{DeviceChoice, Execution};
use mrfgs::threads;

use crate::process;

/// Where a match runs.
#[derive(clap::Args)]
#[command(next_help_heading = "Where it runs (changes no bit of the result)")]
pub(crate) struct ExecutionArgs {
    /// auto: a GPU if there is one, else the CPU; cpu: the CPU; gpu: the fastest device, or an error if there
    /// is none; or a device by its index in `mrfgs devices` or a part of its name
    #[arg(long, default_value = "auto", value_name = "auto|cpu|gpu|NAME|INDEX")]
    device: DeviceChoice,
    #[command(flatten)]
    threads: ThreadArgs,
}

/// The largest number of threads.
const MOST: i64 = Execution::MOST_THREADS as i64;

/// How many threads the CPU path has.
#[derive(clap::Args)]
pub(crate) struct ThreadArgs {
    /// Threads of the CPU path at most, 1 to 1024 [default: as many as processors that the process may use, by affinity and
    /// cgroups, or fewer by `RAYON_NUM_THREADS`, `OMP_NUM_THREADS` or Slurm]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=MOST))]
    pub(crate) threads: Option<u16>,
}

impl ThreadArgs {
    /// Bounds what is done around a match, too: reading, and the search for what may be wrong.
    pub(crate) fn limit(&self) {
        threads::limit(self.threads.map_or(0, usize::from));
        // Begun before anybody counts what memory is left, as the threads of a matcher are.
        threads::run(|| ());
    }

    /// How the library takes it with `device`; the time of stages is not taken.
    pub(crate) fn execution(&self, device: &DeviceChoice) -> Execution {
        Execution { device: device.clone(), threads: self.threads.map(usize::from), timings: false }
    }
}

impl ExecutionArgs {
    /// How the library takes it. Where the drivers are asked it may start the program anew, so it comes before all else.
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
