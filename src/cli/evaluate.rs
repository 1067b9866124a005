//! `mrfgs evaluate`.

use std::path::{Path, PathBuf};

use mrfgs::evaluation::{GroundTruth, Report, Row, mean, table};
use mrfgs::image::{Pair, Plane, calib::Calibration, read, write};
use mrfgs::options::{DisparityRange, Method};
use mrfgs::{Error, Matcher, Result};
use serde::Serialize;

use super::{ExecutionArgs, MethodArgs, outputs};

const EXAMPLES: &str = "\
Examples:
  mrfgs evaluate Teddy Cones
  mrfgs evaluate Teddy --preset paper --json figures.json
  mrfgs evaluate --disparity mine.pfm --truth Teddy/disp0GT.pfm --mask Teddy/mask0nocc.png";

/// The files of a folder in the layout of the Middlebury benchmark.
const FILES: [&str; 4] = ["im0.png", "im1.png", "disp0GT.pfm", "calib.txt"];

/// Match pairs with known truth, or take a finished map, and print its errors
///
/// A DIR has the layout of the Middlebury benchmark: im0.png, im1.png, disp0GT.pfm, calib.txt with ndisp, and where there
/// is one mask0nocc.png. The table shows the map before post-processing (raw) and the final one: average error, RMS (px),
/// PSNR against 255 (dB), pixels wrong by more than 0.5, 1, 2 and 4 px or invalid (%), and valid ones (%), over all pixels
/// with known truth and over those that both views see (nonocc).
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Folders to match and evaluate
    #[arg(required_unless_present = "disparity", value_name = "DIR")]
    dirs: Vec<PathBuf>,
    /// Writes all figures as JSON; `-` prints them instead of the table
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    execution: ExecutionArgs,

    /// Evaluates this map instead, whoever made it: .pfm, float .tif, or 16-bit .png with disparity times 256
    #[arg(
        long,
        value_name = "FILE",
        requires = "truth",
        conflicts_with_all = ["dirs", "preset", "config", "set", "backend", "device", "threads"],
        help_heading = "Maps that others made"
    )]
    disparity: Option<PathBuf>,
    /// Its ground truth, in one of the same formats; what is invalid there does not count
    #[arg(long, value_name = "FILE", requires = "disparity", help_heading = "Maps that others made")]
    truth: Option<PathBuf>,
    /// Its mask: 255 where both views see the pixel, anything else where not
    #[arg(long, value_name = "FILE", requires = "disparity", help_heading = "Maps that others made")]
    mask: Option<PathBuf>,
}

/// The mask's name in such a folder, which may lack it.
const MASK: &str = "mask0nocc.png";

/// Everything that the evaluation found, as JSON has it.
#[derive(Serialize)]
struct Findings {
    method: Option<Method>,
    ran_on: Option<String>,
    pairs: Vec<Figures>,
    mean: Mean,
}

/// The figures of one pair.
#[derive(Serialize)]
struct Figures {
    name: String,
    raw: Option<Report>,
    #[serde(rename = "final")]
    finished: Report,
    seconds: Option<f64>,
}

/// The means over all pairs.
#[derive(Serialize)]
struct Mean {
    raw: Option<Report>,
    #[serde(rename = "final")]
    finished: Option<Report>,
}

impl Findings {
    fn new(method: Option<Method>, ran_on: Option<String>, pairs: Vec<Figures>) -> Self {
        let raw = pairs.iter().map(|f| f.raw.as_ref()).collect::<Option<Vec<_>>>().and_then(mean);
        let finished = mean(pairs.iter().map(|f| &f.finished));
        Self { method, ran_on, pairs, mean: Mean { raw, finished } }
    }
}

pub(super) fn run(args: &Args) -> Result<()> {
    let json_file = args.json.as_deref().filter(|path| *path != Path::new("-"));
    if let Some(path) = json_file {
        write::check_path(path)?;
        let files = FILES.into_iter().chain([MASK]);
        let mut inputs: Vec<PathBuf> = files.flat_map(|f| args.dirs.iter().map(move |d| d.join(f))).collect();
        inputs.extend(
            [&args.disparity, &args.truth, &args.mask, &args.method.config].into_iter().flatten().cloned(),
        );
        let inputs: Vec<_> = inputs.iter().map(|path| ("an input", path.as_path())).collect();
        outputs::distinct(&inputs, &[("--json", path)])?;
    }
    let findings = match (&args.disparity, &args.truth) {
        (Some(map), Some(truth)) => {
            Findings::new(None, None, vec![finished_map(map, truth, args.mask.as_deref())?])
        }
        _ => match_all(args)?,
    };
    if let Some(path) = &args.json {
        let mut text = serde_json::to_string_pretty(&findings).map_err(|e| Error::write(path, e))?;
        text.push('\n');
        if json_file.is_none() {
            return super::print(&text);
        }
        write::save(path, text.as_bytes())?;
    }
    let row = |f: Figures| Row { pair: f.name, raw: f.raw, finished: Some(f.finished) };
    super::print(&table(&findings.pairs.into_iter().map(row).collect::<Vec<_>>()))
}

/// The figures of a map that is there already.
fn finished_map(map: &Path, truth: &Path, mask: Option<&Path>) -> Result<Figures> {
    let estimate = read::read_disparity(map)?;
    let ground = ground_truth(truth, mask, map, estimate.size())?;
    let name = map.file_stem().unwrap_or(map.as_os_str()).to_string_lossy().into_owned();
    Ok(Figures { name, raw: None, finished: ground.evaluate(&estimate)?, seconds: None })
}

/// The truth and the mask for `what`, which is of the given size.
fn ground_truth(truth: &Path, mask: Option<&Path>, what: &Path, size: (usize, usize)) -> Result<GroundTruth> {
    fn fits<T>(plane: Plane<T>, path: &Path, what: &Path, size: (usize, usize)) -> Result<Plane<T>> {
        if plane.size() == size {
            return Ok(plane);
        }
        let (w, h) = plane.size();
        Err(Error::Mismatch(format!(
            "{} is {w} x {h} and {} is {} x {}: give files of the same pair at the same size",
            path.display(),
            what.display(),
            size.0,
            size.1
        )))
    }
    let plane = fits(read::read_disparity(truth)?, truth, what, size)?;
    if !plane.data().iter().any(|d| d.is_finite()) {
        return Err(Error::read(truth, "holds no known disparity; nothing can be compared with it"));
    }
    let mask = mask.map(|path| fits(read::grey8(path)?, path, what, size)).transpose()?;
    GroundTruth::new(plane, mask)
}

/// One folder, read.
struct Scene {
    name: String,
    pair: Pair,
    range: DisparityRange,
    ground: GroundTruth,
}

impl Scene {
    fn read(dir: &Path) -> Result<Self> {
        let at = |file: &str| dir.join(file);
        let calib = at("calib.txt");
        let range = super::calibrated_range(&calib, &Calibration::read(&calib)?, 0)?.ok_or_else(|| {
            Error::read(&calib, "does not say ndisp, the number of disparities; add ndisp=N")
        })?;
        let pair = read::pair(&at("im0.png"), &at("im1.png"), None)?;
        let mask = Some(at(MASK)).filter(|m| m.exists());
        let ground = ground_truth(&at("disp0GT.pfm"), mask.as_deref(), &at("im0.png"), pair.size())?;
        let full = dir.canonicalize().unwrap_or_else(|_| dir.to_owned());
        let name = full.file_name().unwrap_or(dir.as_os_str()).to_string_lossy().into_owned();
        Ok(Self { name, pair, range, ground })
    }
}

/// Matches every folder.
fn match_all(args: &Args) -> Result<Findings> {
    let method = args.method.method()?;
    let execution = args.execution.execution()?;
    // What is missing in the last folder is said before the first is matched.
    for dir in &args.dirs {
        for path in FILES.map(|file| dir.join(file)) {
            if !path.is_file() {
                let reason =
                    format!("there is no such file; a folder to evaluate holds {}", FILES.join(", "));
                return Err(Error::read(path, reason));
            }
        }
    }
    let mut matcher = Matcher::new(&execution)?;
    let mut figures = Vec::new();
    let mut ran_on = None;
    for dir in &args.dirs {
        let scene = Scene::read(dir)?;
        let name = Some(scene.name.as_str());
        let (matched, time) =
            super::match_and_tell(&mut matcher, &scene.pair, scene.range, &method, name, false)?;
        figures.push(Figures {
            raw: Some(scene.ground.evaluate(&matched.maps.raw_map())?),
            finished: scene.ground.evaluate(&matched.maps.final_map())?,
            name: scene.name,
            seconds: Some(time.as_secs_f64()),
        });
        ran_on = Some(matched.ran_on);
    }
    Ok(Findings::new(Some(method), ran_on, figures))
}
