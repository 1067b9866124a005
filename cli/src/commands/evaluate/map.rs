//! `mrfgs evaluate map`: the errors of a finished map.

use std::path::PathBuf;

use crate::args::reading::ReadingArgs;
use crate::failure::Result;
use crate::outputs::files;
use crate::pairs::folder;

use super::findings::{Figures, Findings};
use super::metrics;
use super::report::{self, ReportArgs};
use super::scenes::{self, FigureArgs};

const EXAMPLES: &str = "\
Examples:
  mrfgs evaluate map mine.pfm --truth disp0GT.pfm --mask mask0nocc.png";

/// Print the errors of a finished map, from any matcher
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Map to evaluate: .pfm, float .tif, or 16-bit .png with disparity times 256
    map: PathBuf,
    /// Ground truth, in one of the same formats, or an 8-bit .png with --truth-scale; pixels that are invalid there do not
    /// count
    #[arg(long, value_name = "FILE")]
    truth: PathBuf,
    /// Mask: 255 where both views see the pixel, anything else where not
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
    #[command(flatten)]
    report: ReportArgs,
    #[command(flatten)]
    figures: FigureArgs,
    #[command(flatten)]
    reading: ReadingArgs,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let json = args.figures.json.as_deref();
    let destination = args.report.destination(json)?;
    let inputs = [Some(&args.map), Some(&args.truth), args.mask.as_ref()];
    scenes::check_json(json, &inputs.into_iter().flatten().cloned().collect::<Vec<_>>())?;
    let reader = args.reading.reader();
    let estimate = reader.disparity(&args.map)?;
    let (scale, mask) = (args.figures.truth_scale, args.mask.as_deref());
    let ground = folder::ground_truth(reader, &args.truth, scale, mask, &args.map, estimate.size())?;
    let figures = Figures {
        name: args.map.file_stem().unwrap_or(args.map.as_os_str()).to_string_lossy().into_owned(),
        raw: None,
        finished: ground.evaluate(&estimate)?,
        breakdown: None,
        confidence: None,
        validity: None,
        seconds: None,
    };
    let pictures =
        destination.as_ref().map(|_| report::pictures(&figures.name, ground.truth(), &estimate, None));
    let pictures: Vec<_> = pictures.transpose()?.into_iter().collect();
    let findings = Findings::new(None, None, vec![figures]);
    files::deliver(json, &findings, &metrics::text(&findings), |_| match destination {
        Some(destination) => report::write(&destination, &findings, &pictures),
        None => Ok(()),
    })
}
