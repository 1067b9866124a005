//! The arguments of `mrfgs bench`.

use std::path::PathBuf;

use mrfgs::options::DeviceChoice;

use crate::args::{MethodArgs, ReadingArgs, ThreadArgs};

use super::synthetic::{LARGE, SMALL, Synthetic};

const EXAMPLES: &str = "\
Examples:
  mrfgs bench
  mrfgs bench --large --device gpu --repeats 20
  mrfgs bench Teddy Motorcycle --method default --json bench.json
  mrfgs bench Teddy --device cpu --threads 1 --set levels=4";

const METHOD: &str = "A preset, or a TOML file that overrides keys of the preset [default: default and paper, one after the other]";

/// Measure how long matches take on the CPU and on a GPU, and compare with the memory bandwidth
///
/// Every pair is matched by the presets default and paper, or by the method of --method, on each device: once to warm up and then several
/// times, without file access in between, like a program that keeps its `Matcher`. Each pair, method and device runs in its own process.
/// Figures are medians; each repeat is one match for the total time and another for the stage times, by the device's own clock if it has
/// one.
///
/// A label update is one value of a dependency message: per iteration pixels x labels x members of a factor, summed over the active levels,
/// including labels outside the kept windows. Labels kept is the share that volumes store within label windows. The message stages are
/// dependency, resolution and belief; each run moves at least the volumes that it reads and writes. The copy rate (bytes read plus written,
/// between two large buffers, measured after the matches) is the bound for this; volumes that fit into caches can be faster. Processor time
/// sums over all threads; peak memory is that of the process, including buffers of a software device. Matches that need more memory than
/// available are reported and skipped.
///
/// --json contains `version`, `threads`, `repeats`, `methods` (by name: their keys) and `pairs`, one entry per pair and method: `name`,
/// `method`, `width`, `height`, `labels` and `devices` (named as in --device, null if memory was too small: `ran_on`, `iterations`,
/// `labels_kept` (% by level), `median_ms`, `min_ms`, `max_ms`, `runs_ms`, `processor_ms`, `stages` (ms by stage and level), `message_ms`,
/// `label_updates`, `message_gupdates_per_s`, `match_gupdates_per_s`, `message_bytes`, `message_gb_per_s`, `copy_gb_per_s`, `copy_share`
/// (%), `plan_bytes`, `peak_bytes`, `device_bytes`, `dispatches`, `submissions`, `bytes_up`, `bytes_down`).
#[derive(clap::Args)]
#[command(after_help = EXAMPLES, mut_arg("method", |method| method.help(METHOD)))]
pub(crate) struct Args {
    /// Folders with a pair each, in the layouts of `evaluate`; the ground truth is not needed if a calib.txt gives the range [default: a
    /// generated pair of 450 x 375 pixels and 60 labels]
    #[arg(value_name = "DIR")]
    pub(super) dirs: Vec<PathBuf>,
    /// Uses a generated pair of 2964 x 2000 pixels and 280 labels instead
    #[arg(long, conflicts_with = "dirs")]
    pub(super) large: bool,
    /// How often each match is repeated, 1 to 1000
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub(super) repeats: u16,
    /// Writes all figures as JSON; `-` prints them instead of the table
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
    #[command(flatten)]
    pub(super) reading: ReadingArgs,

    #[command(flatten)]
    pub(super) method: MethodArgs,
    /// Device to measure: cpu, gpu, auto, an index in `mrfgs devices` or part of a name. May be repeated
    #[arg(
        long,
        value_name = "auto|cpu|gpu|NAME|INDEX",
        default_values = ["cpu", "auto"],
        help_heading = "Where it runs"
    )]
    pub(super) device: Vec<DeviceChoice>,
    #[command(flatten)]
    pub(super) threads: ThreadArgs,
}

impl Args {
    /// The generated pair, used without DIR.
    pub(super) fn made_up(&self) -> Synthetic {
        if self.large { LARGE } else { SMALL }
    }
}
