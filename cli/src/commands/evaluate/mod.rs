//! `mrfgs evaluate`.

mod breakdown;
mod findings;
mod map;
mod metrics;
mod pairs;
mod prior;
mod report;
mod scenes;
mod submission;

use std::path::PathBuf;

use clap::Subcommand;

use crate::failure::{Failure, Result};

const EXAMPLES: &str = "\
Examples:
  mrfgs evaluate Teddy Cones
  mrfgs evaluate Teddy --method paper --json figures.json
  mrfgs evaluate Teddy Cones --report report  # then open report/index.html
  mrfgs evaluate Teddy --method paper --method fgs --report report
  mrfgs evaluate Teddy Cones --breakdown
  mrfgs evaluate HalfSize/Art --truth-scale 2
  mrfgs evaluate map mine.pfm --truth disp0GT.pfm --mask mask0nocc.png";

const METHOD: &str = "A preset, or a TOML file that overrides keys of the preset; `mrfgs presets` lists both. May be repeated: files \
    override what is before them, and each further preset begins another method to compare [default: default]";

/// Match pairs with ground truth and print their errors
///
/// DIR has the layout of a Middlebury data set: im0.png, im1.png, disp0GT.pfm and calib.txt with ndisp (2014); view1.png, view5.png and
/// disp1.png (2005, 2006); or im2.png, im6.png and disp2.png (2003). The ground truth of the older sets has 8 bits (see --truth-scale);
/// without a calib.txt their range is from 0 to the largest known disparity, rounded up. An optional mask0nocc.png marks pixels seen by
/// both views (255). For a folder named like a command, write ./map.
///
/// The table shows the map before post-processing (raw) and the final one: average error, RMS (px), PSNR against 255 (dB), pixels wrong by
/// more than 0.5, 1, 2 and 4 px or invalid (%), and valid ones (%), over all pixels with ground truth and over those seen by both views
/// (nonocc).
///
/// Several presets (--method paper --method fgs) are compared: each has a table, and a report shows their maps side by side. --set applies
/// to all of them. --json then contains the first method with its `name`, and the others under `beside`.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES, mut_arg("method", |method| method.help(METHOD)))]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(disable_help_subcommand = true)]
pub(crate) struct Args {
    #[command(subcommand)]
    mode: Option<Mode>,
    #[command(flatten)]
    pairs: pairs::PairsArgs,
}

#[derive(Subcommand)]
enum Mode {
    Map(map::Args),
    Submission(submission::Args),
}

pub(crate) fn run(args: &Args) -> Result<()> {
    match &args.mode {
        None => {
            check_modes(&args.pairs)?;
            pairs::run(&args.pairs)
        }
        Some(Mode::Map(args)) => map::run(args),
        Some(Mode::Submission(args)) => submission::run(args),
    }
}

/// Refuses the name of a mode among the folders: after a flag, the parser takes it for a folder.
fn check_modes(args: &pairs::PairsArgs) -> Result<()> {
    let is_mode =
        |dir: &&PathBuf| dir.to_str().is_some_and(<Mode as Subcommand>::has_subcommand) && !dir.is_dir();
    match args.dirs.iter().find(is_mode) {
        Some(mode) => Err(Failure::usage(mode.display(), "put it right after `evaluate`, before all flags")),
        None => Ok(()),
    }
}
