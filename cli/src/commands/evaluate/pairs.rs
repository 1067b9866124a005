//! `mrfgs evaluate DIR...`: pairs are matched and compared with their truth.

use std::path::PathBuf;

use mrfgs::Matcher;

use crate::args::execution::ExecutionArgs;
use crate::args::method::MethodArgs;
use crate::failure::Result;
use crate::outputs::files;
use crate::stop;

use super::report::{self, ReportArgs};
use super::scenes::{self, SceneArgs};
use super::{breakdown, metrics};

/// What to match and print.
#[derive(clap::Args)]
pub(super) struct PairsArgs {
    /// Folders to match and evaluate
    #[arg(required = true, value_name = "DIR")]
    pub(super) dirs: Vec<PathBuf>,
    /// Prints two more tables: where the errors of the final map are, and how good confidence and validity are
    ///
    /// The first table puts every pixel with known truth into the first class that applies: border (its match, x - truth, lies
    /// outside the right image), occluded (the mask says that one view does not see it), edge (the known truths in the
    /// 7 x 7 window around it span more than 4 px), plain (the grey in this window has a standard deviation below 4
    /// eight-bit levels), slanted (the truth changes by at least 0.2 px per pixel), other. For each class it shows `share`,
    /// its pixels, and `bad`, those of them that are wrong by more than 2 px or invalid, both in percent of all pixels with
    /// known truth: the bad ones of all classes add up to b2%.
    ///
    /// The second table orders the pixels by confidence, the surest first (Hu and Mordohai 2012). `AUC` is the mean over all k
    /// of the share of bad pixels among the k surest (%); it is small if the confidence is low where pixels are bad. `optimal`
    /// is the AUC if all bad pixels came last, `random` that of a confidence that knows nothing. `precision` is the share of
    /// pixels that one view does not see, by the mask, among those flagged as outside, occluded or in a small region;
    /// `recall` is the share of flagged pixels among those that one view does not see.
    ///
    /// --json holds these figures for each pair and for the mean in any case: `breakdown` by class (`share`; `bad2.0` and
    /// `avg` of its own pixels; `points`, the `bad` above; `of_bad` and `of_squares`, its share of all bad pixels and of the
    /// summed squared error), `confidence` (`auc`, `optimal`, `random`, and `curve`, the share of bad pixels among the surest
    /// 5, 10, ... 100 %) and `validity` (`precision`, `recall`; null without a mask).
    #[arg(long)]
    breakdown: bool,
    #[command(flatten)]
    report: ReportArgs,
    #[command(flatten)]
    scenes: SceneArgs,

    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    pub(super) execution: ExecutionArgs,
}

pub(super) fn run(args: &PairsArgs) -> Result<()> {
    stop::listen();
    let destination = args.report.destination(args.scenes.json())?;
    args.scenes.check_json(&args.dirs, &args.method)?;
    let method = args.method.method()?;
    let folders = args.scenes.folders(&args.dirs)?;
    let mut matcher = Matcher::builder().execution(args.execution.execution()).build()?;
    let mut pictures = Vec::new();
    let findings = scenes::match_all(&args.scenes, &folders, &mut matcher, method, |scene, maps, _| {
        if destination.is_some() {
            let (truth, estimate) = (scene.ground.truth(), maps.final_map());
            pictures.push(report::pictures(&scene.name, truth, &estimate, Some((&scene.pair, maps)))?);
        }
        Ok(())
    })?;
    let mut text = metrics::text(&findings);
    if args.breakdown {
        text.push_str(&breakdown::text(&findings));
    }
    files::deliver(args.scenes.json(), &findings, &text, |_| match destination {
        Some(destination) => report::write(&destination, &findings, &pictures),
        None => Ok(()),
    })
}
