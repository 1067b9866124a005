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

const METHOD: &str = "A preset, or a TOML file whose keys replace those of the preset [default: default and paper, one after the other]";

/// Measure how long matches take on the CPU and on a device, beside what the machine could do
///
/// Every pair is matched by the presets default and paper, or by the method of --method, on each device: once
/// to warm up and then several times, without reading or writing files in between, like a program that keeps
/// its `Matcher`. Each pair, method and device has a process of its own. Figures are medians; each repeat is
/// one match for the whole time and one more for the times of the stages, by the device's own clock if it has
/// one.
///
/// A label update is one value of a dependency message: per iteration pixels x labels x members of a factor,
/// summed over the levels that take part, labels that are not kept included. Labels kept is the share that
/// volumes hold after label windows have left out the rest. The message stages are dependency, resolution and
/// belief. They move at least every volume that they read or write once per run. The copy rate (bytes read
/// and written, from one large buffer to another, measured after the matches) shows how fast that could be;
/// volumes that fit into caches can be faster. Processor time is that of all threads, peak memory the most
/// that the process held, including the buffers of a software device. Matches that need more memory than
/// there is are named and left out.
///
/// --json holds `version`, `threads`, `repeats`, `methods` (by name: their keys) and `pairs`, one entry for each pair and
/// method: `name`, `method`, `width`, `height`, `labels` and `devices` (as --device names them, null without the memory:
/// `ran_on`, `iterations`, `labels_kept` (% by level), `median_ms`, `min_ms`, `max_ms`, `runs_ms`, `processor_ms`, `stages` (ms by stage and level),
/// `message_ms`, `label_updates`, `message_gupdates_per_s`, `match_gupdates_per_s`, `message_bytes`, `message_gb_per_s`,
/// `copy_gb_per_s`, `copy_share` (%), `plan_bytes`, `peak_bytes`, `device_bytes`,
/// `dispatches`, `submissions`, `bytes_up`, `bytes_down`).
#[derive(clap::Args)]
#[command(after_help = EXAMPLES, mut_arg("method", |method| method.help(METHOD)))]
pub(crate) struct Args {
    /// Folders with a pair each, in the layouts of `evaluate`; if a calib.txt gives the range, the truth may be missing
    /// [default: a made-up pair of 450 x 375 pixels and 60 labels]
    #[arg(value_name = "DIR")]
    pub(super) dirs: Vec<PathBuf>,
    /// Makes up a pair of 2964 x 2000 pixels and 280 labels instead
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
    /// A device to measure: cpu, gpu, auto, or its index in `mrfgs devices` or a part of its name; given several times, each in
    /// turn
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
    /// The pair where no folder is given.
    pub(super) fn made_up(&self) -> Synthetic {
        if self.large { LARGE } else { SMALL }
    }
}
