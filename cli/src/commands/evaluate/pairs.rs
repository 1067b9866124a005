//! `mrfgs evaluate DIR...`: matches pairs and compares the maps with their ground truth.

use std::path::PathBuf;

use mrfgs::maps::Maps;

use crate::failure::Result;
use crate::pairs::folder::Scene;
use crate::stop;

use super::findings::Findings;
use super::prior::SampledPoints;
use super::report::{self, Pictures, ReportArgs};
use super::scenes::{Called, RunArgs};
use super::{breakdown, metrics};

/// The arguments of an evaluation.
#[derive(clap::Args)]
pub(super) struct PairsArgs {
    /// Folders to match and evaluate
    #[arg(required = true, value_name = "DIR")]
    pub(super) dirs: Vec<PathBuf>,
    /// Prints two more tables: where errors of the final map occur, and how good confidence and validity are
    ///
    /// The first table puts every pixel with ground truth into the first class that applies: border (its match, x - truth, lies outside the
    /// right image), occluded (according to the mask, one view does not see it), edge (known truths in the surrounding 7 x 7 window span
    /// more than 4 px), plain (the grey values in this window have a standard deviation below 4 eight-bit levels), slanted (the truth
    /// changes by at least 0.2 px per pixel), other. For each class it shows `share`, its pixels, and `bad`, those wrong by more than 2 px
    /// or invalid, both in percent of all pixels with ground truth: the bad ones of all classes add up to b2%.
    ///
    /// The second table orders the pixels by decreasing confidence (Hu and Mordohai 2012). `AUC` is the mean over all k of the share of bad
    /// pixels among the k most confident (%), small for a good confidence. `optimal` is the AUC with all bad pixels last, `random` that of
    /// a random order. `precision` is the share of pixels that one view does not see, according to the mask, among those flagged as
    /// outside, occluded or in a small region; `recall` is the share of flagged pixels among those that one view does not see.
    ///
    /// --json always contains these figures for each pair and the mean: `breakdown` by class (`share`; `bad2.0` and `avg` over its own
    /// pixels; `points`, the `bad` above; `of_bad` and `of_squares`, its share of all bad pixels and of the summed squared error),
    /// `confidence` (`auc`, `optimal`, `random`, and `curve`, the share of bad pixels among the 5, 10, ... 100 % most confident) and
    /// `validity` (`precision`, `recall`; null without a mask).
    #[arg(long)]
    breakdown: bool,
    /// Gives each match a prior of points: a share of the known truth, which the figures then leave out
    ///
    /// SHARE is from 0 to 1. The points may have noise (a standard deviation in pixels), a share of outliers with random disparities, and lie
    /// in evenly spaced rows alone, like those of a lidar: 0.01,0.5,0.2,16.
    #[arg(long, value_name = "SHARE[,NOISE[,OUTLIERS[,ROWS]]]", value_parser = SampledPoints::parse)]
    prior_from_truth: Option<SampledPoints>,
    /// The seed of the sampled points
    #[arg(long, value_name = "N", default_value_t = 1, requires = "prior_from_truth")]
    prior_seed: u64,
    #[command(flatten)]
    report: ReportArgs,
    #[command(flatten)]
    run: RunArgs,
}

pub(super) fn run(args: &PairsArgs) -> Result<()> {
    let execution = args.run.execution();
    stop::listen();
    let json = args.run.json();
    let begun = args.report.begin(json)?;
    let sampled = args.prior_from_truth.map(|points| (points, args.prior_seed));
    let (first, others) = args.run.methods()?;
    let mut pictures: Vec<_> = args.dirs.iter().map(|_| Pictures::default()).collect();
    let mut matched = |(name, method): Called| {
        let mut of_pairs = pictures.iter_mut();
        let see = |scene: &Scene, maps: &Maps, _| {
            if let (Some(_), Some(of_pair)) = (&begun, of_pairs.next()) {
                let (truth, estimate) = (scene.ground.truth(), maps.final_map());
                of_pair.add(&scene.name, truth, &estimate, Some((&scene.pair, maps)))?;
            }
            Ok(())
        };
        let found = args.run.match_all(&args.dirs, method, execution.clone(), sampled, see)?;
        Ok(Findings { name, ..found })
    };
    let mut findings = matched(first)?;
    findings.beside = others.into_iter().map(matched).collect::<Result<_>>()?;
    let texts = findings.of_each_method().map(|findings| {
        let head = findings.name.as_ref().map(|name| format!("method {name}\n")).unwrap_or_default();
        let breakdown = if args.breakdown { breakdown::text(findings) } else { String::new() };
        head + &metrics::text(findings) + &breakdown
    });
    let text = texts.collect::<Vec<_>>().join("\n");
    report::deliver(json, &findings, &text, begun, &pictures)
}
