//! `mrfgs evaluate map`: the errors of a finished map.

use std::path::PathBuf;

use mrfgs::image::Plane;

use crate::args::{disparity, scale};
use crate::console;
use crate::failure::Result;
use crate::outputs::files;
use crate::pairs::folder;

use super::findings::{Figures, Findings, Scored};
use super::metrics;
use super::report::{self, Pictures, ReportArgs};
use super::scenes::SceneArgs;

const EXAMPLES: &str = "\
Examples:
  mrfgs evaluate map mine.pfm --truth disp0GT.pfm --mask mask0nocc.png";

/// Print the errors of a finished map from any matcher
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Map to evaluate: .pfm, float .tif or .npy, or 16-bit .png with disparity times 256; other integers with --scale
    map: PathBuf,
    /// Grey levels per pixel of disparity, for integers in MAP; level 0 is unknown [default: 256 for 16-bit PNG]
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = scale)]
    scale: Option<f32>,
    /// Ground truth in one of the same formats, or integers with --truth-scale; its invalid pixels are ignored
    #[arg(long, value_name = "FILE")]
    truth: PathBuf,
    /// Mask: 255 for pixels seen by both views, anything else for others
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
    #[command(flatten)]
    report: ReportArgs,
    #[command(flatten)]
    scenes: SceneArgs,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let SceneArgs { json, truth_scale, truth_rounded, reading } = &args.scenes;
    let json = json.as_deref();
    let begun = args.report.begin(json)?;
    let inputs = [Some(&args.map), Some(&args.truth), args.mask.as_ref()];
    files::check_json(json, inputs.into_iter().flatten().cloned())?;
    let reader = reading.reader();
    let estimate = disparity(reader, &args.map, args.scale)?;
    let (map, mask) = (&args.map, args.mask.as_deref());
    let ground = folder::ground_truth(reader, &args.truth, *truth_scale, mask, map, estimate.size())?;
    let ground = if *truth_rounded { ground.rounded() } else { ground };
    if is_negated(&estimate, ground.truth()) {
        let [map, truth] = [map, &args.truth].map(|path| path.display());
        console::say(&format!("warning: {map} and {truth} seem to use opposite signs: negate one of them"));
    }
    let name = map.file_stem().unwrap_or(map.as_os_str()).to_string_lossy().into_owned();
    let mut pictures = Pictures::default();
    if begun.is_some() {
        pictures.add(&name, ground.truth(), &estimate, None)?;
    }
    let figures = Figures { finished: Some(ground.evaluate(&estimate)?), ..Figures::default() };
    let findings = Findings::new(None, None, vec![Scored { name, figures, seconds: None }]);
    report::deliver(json, &findings, &metrics::text(&findings), begun, &[pictures])
}

/// Whether negating a map brings it much closer to the ground truth.
fn is_negated(map: &Plane<f32>, truth: &Plane<f32>) -> bool {
    let both = || map.data().iter().zip(truth.data()).filter(|(d, truth)| d.is_finite() && truth.is_finite());
    let apart = |sign: f32| both().map(|(d, truth)| f64::from((sign * d - truth).abs())).sum::<f64>();
    2.0 * apart(-1.0) < apart(1.0)
}
