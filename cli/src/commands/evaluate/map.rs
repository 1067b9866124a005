//! `mrfgs evaluate map`: the errors of a finished map.

use std::path::{Path, PathBuf};

use mrfgs::Error;
use mrfgs::image::Plane;

use crate::args::{disparity, scale};
use crate::console;
use crate::failure::{Failure, Result};
use crate::outputs::files;
use crate::pairs::folder;
use crate::sequences::files::{list, stem};

use super::findings::{Figures, Findings, Scored};
use super::metrics;
use super::report::{self, Pictures, ReportArgs};
use super::scenes::SceneArgs;

const EXAMPLES: &str = "\
Examples:
  mrfgs evaluate map mine.pfm --truth disp0GT.pfm --mask mask0nocc.png
  mrfgs evaluate map maps --truth training/disp_occ_0";

/// Formats of maps, in a folder with several of the same name the first.
const FORMATS: [&str; 5] = ["pfm", "tif", "tiff", "npy", "png"];

/// Print the errors of finished maps from any matcher
///
/// MAP, `--truth` and `--mask` are files, or folders: then each file in the folder of the truth, such as `000001_10.png`, has a map (and a
/// mask) of the same name, whatever its extension.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Map to evaluate: .pfm, float .tif or .npy, or 16-bit .png with disparity times 256; other integers with --scale. Or a folder of maps
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

/// The files of one map.
struct Files {
    map: PathBuf,
    truth: PathBuf,
    mask: Option<PathBuf>,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let json = args.scenes.json.as_deref();
    let begun = args.report.begin(json)?;
    let all = files_of(args)?;
    let inputs = all.iter().flat_map(|one| [Some(&one.map), Some(&one.truth), one.mask.as_ref()]);
    files::check_json(json, inputs.flatten().cloned())?;
    let mut pictures = Vec::new();
    let mut scored = Vec::new();
    for files in &all {
        let (score, drawn) = evaluate(args, files, begun.is_some())?;
        scored.push(score);
        pictures.push(drawn);
    }
    let findings = Findings::new(None, None, scored);
    report::deliver(json, &findings, &metrics::text(&findings), begun, &pictures)
}

/// The errors of one map, and with `drawn` its pictures.
fn evaluate(args: &Args, Files { map, truth, mask }: &Files, drawn: bool) -> Result<(Scored, Pictures)> {
    let SceneArgs { truth_scale, truth_rounded, reading, .. } = &args.scenes;
    let reader = reading.reader();
    let estimate = disparity(reader, map, args.scale)?;
    let ground = folder::ground_truth(reader, truth, *truth_scale, mask.as_deref(), map, estimate.size())?;
    let ground = if *truth_rounded { ground.rounded() } else { ground };
    if is_negated(&estimate, ground.truth()) {
        let [map, truth] = [map, truth].map(|path| path.display());
        console::say(&format!("warning: {map} and {truth} seem to use opposite signs: negate one of them"));
    }
    let name = map.file_stem().unwrap_or(map.as_os_str()).to_string_lossy().into_owned();
    let mut pictures = Pictures::default();
    if drawn {
        pictures.add(&name, ground.truth(), &estimate, None)?;
    }
    let figures = Figures { finished: Some(ground.evaluate(&estimate)?), ..Figures::default() };
    Ok((Scored { name, figures, seconds: None }, pictures))
}

/// The files to compare: those given, or for folders those of each ground truth.
fn files_of(args: &Args) -> Result<Vec<Files>> {
    let (map, truth, mask) = (&args.map, &args.truth, args.mask.as_ref());
    if !map.is_dir() && !truth.is_dir() {
        return Ok(vec![Files { map: map.clone(), truth: truth.clone(), mask: mask.cloned() }]);
    }
    if map.is_dir() != truth.is_dir() {
        let [folder, file] =
            if map.is_dir() { [map, truth] } else { [truth, map] }.map(|path| path.display());
        let reason = format!("{folder} is a folder but {file} is not; give two files or two folders");
        return Err(Failure::usage("--truth", reason));
    }
    let truths = list(truth)?.unwrap_or_default().into_iter();
    let files = truths.map(|truth| {
        let map = of_name(map, &stem(&truth))?;
        let mask = mask.map(|mask| of_name(mask, &stem(&truth))).transpose()?;
        Ok(Files { map, truth, mask })
    });
    files.collect()
}

/// The file in `folder` that is called `name`, without its extension.
fn of_name(folder: &Path, name: &str) -> Result<PathBuf> {
    let names = FORMATS.map(|format| folder.join(format!("{name}.{format}")));
    let reason = || format!("contains no {name} with the ending .{}", FORMATS.join(", ."));
    Ok(names.into_iter().find(|file| file.is_file()).ok_or_else(|| Error::read(folder, reason()))?)
}

/// Whether negating a map brings it much closer to the ground truth.
fn is_negated(map: &Plane<f32>, truth: &Plane<f32>) -> bool {
    let both = || map.data().iter().zip(truth.data()).filter(|(d, truth)| d.is_finite() && truth.is_finite());
    let apart = |sign: f32| both().map(|(d, truth)| f64::from((sign * d - truth).abs())).sum::<f64>();
    2.0 * apart(-1.0) < apart(1.0)
}
