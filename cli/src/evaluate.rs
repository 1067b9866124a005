//! `mrfgs evaluate`.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;

use mrfgs::evaluation::{Breakdown, Detection, Report, Row, Sparsification, mean, table};
use mrfgs::image::write;
use mrfgs::maps::Maps;
use mrfgs::options::Method;
use mrfgs::{Error, Matcher, Result};
use serde::Serialize;

use crate::ablations::{self, Ablations};
use crate::breakdown;
use crate::folder::{self, Folder, Scene};
use crate::outputs;
use crate::report::{self, Destination, Picture};
use crate::stop;
use crate::submission::Submission;
use crate::tables::{self, Comparison};
use crate::{ExecutionArgs, MethodArgs, ReadArgs};

const EXAMPLES: &str = "\
Examples:
  mrfgs evaluate Teddy Cones
  mrfgs evaluate Teddy --preset paper --json figures.json
  mrfgs evaluate Teddy Cones --report report  # then open report/index.html
  mrfgs evaluate Teddy Cones Dolls Rocks1 Motorcycle --tables
  mrfgs evaluate HalfSize/Art --truth-scale 2
  mrfgs evaluate Teddy Cones --breakdown
  mrfgs evaluate Teddy Cones --ablations --json ablations.json
  mrfgs evaluate MiddEval3/trainingQ/* --submission trainingQ MRFGS
  mrfgs evaluate --disparity mine.pfm --truth disp0GT.pfm --mask mask0nocc.png";

/// Match pairs with known truth, or take a finished map, and print its errors
///
/// A DIR has the layout of one of the Middlebury sets, told by what it holds: im0.png, im1.png, disp0GT.pfm and calib.txt
/// with ndisp (2014); view1.png, view5.png and disp1.png (2005, 2006); or im2.png, im6.png and disp2.png (2003). Of the older
/// ones the truth has 8 bits (see --truth-scale), and without a calib.txt the range is from 0 to its largest disparity,
/// rounded up. Where there is one, mask0nocc.png says which pixels both views see (255).
///
/// The table shows the map before post-processing (raw) and the final one: average error, RMS (px), PSNR against 255 (dB),
/// pixels wrong by more than 0.5, 1, 2 and 4 px or invalid (%), and valid ones (%), over all pixels with known truth and
/// over those that both views see (nonocc).
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Folders to match and evaluate
    #[arg(required_unless_present = "disparity", value_name = "DIR")]
    dirs: Vec<PathBuf>,
    /// Writes all figures as JSON; `-` prints them instead of the table
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Writes a page with all figures and pictures, index.html, and the pictures as PNG files
    ///
    /// Of each pair it shows the left view, its texture zones, disparity and truth in the same colours, the signed error
    /// (estimate minus truth), confidence and validity. The page needs no other file and no network. A folder that is there must be empty or hold
    /// nothing but an earlier report (its index.html names mrfgs as its generator), which is replaced.
    #[arg(long, value_name = "FOLDER")]
    report: Option<PathBuf>,
    /// Writes the final maps as the Middlebury evaluation (version 3) takes them, into a new folder: of each pair
    /// DIR/PAIR/disp0METHOD.pfm and DIR/PAIR/timeMETHOD.txt
    ///
    /// PAIR is the name of the pair's folder, METHOD of letters, digits, - and _; DIR is to be called trainingF, trainingH or
    /// trainingQ after the size of the pairs. The map has +infinity where there is no disparity; without a fill (--set
    /// fill=none) it counts as sparse, and METHOD is followed by _s. The time is that of the match in seconds.
    #[arg(
        long,
        num_args = 2,
        value_names = ["DIR", "METHOD"],
        conflicts_with_all = ["tables", "ablations", "disparity"]
    )]
    submission: Option<Vec<OsString>>,
    /// Prints the two tables of the paper instead, its figures beside those of the presets fgs, paper and default
    ///
    /// Pairs are known by the names of their folders (Teddy, Cones, Dolls, Rocks1, Motorcycle); others have dashes in the
    /// paper's columns. As --json has it: `source`, `ran_on`, `methods` (by preset: its keys) and `tables`, the raw one and the
    /// final one: `number`, `map`, `pairs` (each: `name`, `published`, `ours`) and `mean` (`published`, `ours`). `published`
    /// holds `fgs` and `mr-fgs` or is null, `ours` one entry a preset; an entry is `avg`, `psnr` and `bad2.0`, over all pixels
    /// with known truth.
    #[arg(long, conflicts_with_all = ["preset", "config", "set", "memory", "report", "disparity"])]
    tables: bool,
    /// Prints two tables more: where the errors of the final map are, and what confidence and validity are worth
    ///
    /// The first puts every pixel with known truth into the first class that applies: border (its match, x - truth, lies
    /// outside the right image), occluded (the mask says that one view does not see it), edge (the known truths in the
    /// 7 x 7 window around it span more than 4 px), plain (the grey in this window has a standard deviation below 4
    /// eight-bit levels), slanted (the truth changes by at least 0.2 px per pixel), other. Of each class: `share`, its pixels,
    /// and `bad`, those of them wrong by more than 2 px or invalid, both in percent of all pixels with known truth, so that the
    /// bad ones add up to b2%.
    ///
    /// The second orders the pixels by confidence, the surest first (Hu and Mordohai 2012). `AUC` is the mean over all k of
    /// the share of bad pixels among the k surest (%), small where the confidence knows the bad ones; `optimal` is what it
    /// were if all bad ones came last, `random` what it is of a confidence that knows nothing. `precision` is the share of the
    /// pixels flagged as outside, occluded or in a small region that one view indeed does not see, by the mask; `recall` the
    /// share of the latter that are flagged.
    ///
    /// --json has it of each pair and of the mean in any case: `breakdown` by class (`share`; `bad2.0` and `avg` of its own
    /// pixels; `points`, the `bad` above; `of_bad` and `of_squares`, its share of all bad pixels and of the summed squared
    /// error), `confidence` (`auc`, `optimal`, `random`, and `curve`, the share of bad pixels among the surest 5, 10, ... 100 %)
    /// and `validity` (`precision`, `recall`; null without a mask).
    #[arg(long, conflicts_with_all = ["tables", "disparity"])]
    breakdown: bool,
    /// Prints what each part of the preset default is good for instead: a line each with the part switched off or replaced
    ///
    /// Of each line: its changes as --set takes them; means over the pairs, of the final map and over all pixels with known
    /// truth, of the average error (`avg`, px, over valid pixels) and of the pixels wrong by more than 0.5 and 2 px or invalid
    /// (`b0.5%`, `b2%`); `change%`, the change of the last against the default, in percent of it; and `time`, that of all
    /// matches against the default's in this run. As --json has it: `ran_on`, `method` (the default's keys), `pairs` and
    /// `rows` (each: `name`, `changes`, `avg`, `bad0.5`, `bad2.0`, `change`, `time`).
    #[arg(long, conflicts_with_all = ["preset", "config", "set", "memory", "report", "disparity", "tables", "breakdown"])]
    ablations: bool,
    /// Levels of an 8-bit PNG truth that are one pixel of disparity, of which 0 is unknown [default: 3 for the layout of
    /// 2005 and 2006, 4 for that of 2003]
    ///
    /// The defaults are those of the small sizes, third and quarter. Of 2005 and 2006 the full size has 1, the half size 2,
    /// the third size 3.
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = scale)]
    truth_scale: Option<f32>,
    #[command(flatten)]
    reading: ReadArgs,

    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    pub(super) execution: ExecutionArgs,

    /// Evaluates this map instead, whoever made it: .pfm, float .tif, or 16-bit .png with disparity times 256
    #[arg(
        long,
        value_name = "FILE",
        requires = "truth",
        conflicts_with_all = ["dirs", "preset", "config", "set", "memory", "backend", "device", "threads"],
        help_heading = "Maps that others made"
    )]
    disparity: Option<PathBuf>,
    /// Its ground truth, in one of the same formats, or an 8-bit .png with --truth-scale; what is invalid there does not
    /// count
    #[arg(long, value_name = "FILE", requires = "disparity", help_heading = "Maps that others made")]
    truth: Option<PathBuf>,
    /// Its mask: 255 where both views see the pixel, anything else where not
    #[arg(long, value_name = "FILE", requires = "disparity", help_heading = "Maps that others made")]
    mask: Option<PathBuf>,
}

fn scale(text: &str) -> std::result::Result<f32, String> {
    let scale = text.parse().ok().filter(|scale| (0.1..=255.0).contains(scale));
    scale.ok_or_else(|| "give a number from 0.1 to 255, such as 3".into())
}

/// Everything that the evaluation found, as JSON has it.
#[derive(Serialize)]
pub(super) struct Findings {
    pub(super) method: Option<Method>,
    pub(super) ran_on: Option<String>,
    pub(super) pairs: Vec<Figures>,
    pub(super) mean: Mean,
}

/// The figures of one pair.
#[derive(Serialize)]
pub(super) struct Figures {
    pub(super) name: String,
    pub(super) raw: Option<Report>,
    #[serde(rename = "final")]
    pub(super) finished: Report,
    pub(super) breakdown: Option<Breakdown>,
    pub(super) confidence: Option<Sparsification>,
    pub(super) validity: Option<Detection>,
    pub(super) seconds: Option<f64>,
}

/// The means over all pairs.
#[derive(Serialize)]
pub(super) struct Mean {
    pub(super) raw: Option<Report>,
    #[serde(rename = "final")]
    pub(super) finished: Option<Report>,
    pub(super) breakdown: Option<Breakdown>,
    pub(super) confidence: Option<Sparsification>,
    pub(super) validity: Option<Detection>,
}

impl Findings {
    fn new(method: Option<Method>, ran_on: Option<String>, pairs: Vec<Figures>) -> Self {
        let raw = pairs.iter().map(|f| f.raw.as_ref()).collect::<Option<Vec<_>>>().and_then(mean);
        let finished = mean(pairs.iter().map(|f| &f.finished));
        let mean = Mean {
            raw,
            finished,
            breakdown: over(&pairs, |f| f.breakdown.as_ref(), Breakdown::mean),
            confidence: over(&pairs, |f| f.confidence.as_ref(), Sparsification::mean),
            validity: over(&pairs, |f| f.validity.as_ref(), Detection::mean),
        };
        Self { method, ran_on, pairs, mean }
    }
}

/// The mean over all pairs; none where one of them lacks what it is of.
fn over<T>(pairs: &[Figures], of: fn(&Figures) -> Option<&T>, mean: fn(&[&T]) -> Option<T>) -> Option<T> {
    mean(&pairs.iter().map(of).collect::<Option<Vec<_>>>()?)
}

pub(super) fn run(args: &Args) -> Result<()> {
    if args.disparity.is_none() {
        stop::listen();
    }
    let (destination, submission) = check_outputs(args)?;
    if args.tables {
        return compare(args);
    }
    if args.ablations {
        return ablate(args);
    }
    let mut pictures = Vec::new();
    let wanted = destination.is_some();
    let findings = if let (Some(map), Some(truth)) = (&args.disparity, &args.truth) {
        finished_map(map, truth, args, wanted.then_some(&mut pictures))?
    } else {
        let method = args.method.method()?;
        let folders = folders(args)?;
        let mut matcher = Matcher::new(&args.execution.execution()?)?;
        match_all(args, &folders, &mut matcher, method, None, |scene, maps, time| {
            if let Some(submission) = &submission {
                submission.add(&scene.name, &maps.final_map(), time)?;
            }
            if wanted {
                let (truth, estimate) = (scene.ground.truth(), maps.final_map());
                let matched = Some((&scene.pair, maps));
                pictures.push(report::pictures(&scene.name, truth, &estimate, matched)?);
            }
            Ok(())
        })?
    };
    let row =
        |f: &Figures| Row { pair: f.name.clone(), raw: f.raw.clone(), finished: Some(f.finished.clone()) };
    let mut text = table(&findings.pairs.iter().map(row).collect::<Vec<_>>());
    if args.breakdown {
        text.push_str(&breakdown::text(&findings));
    }
    outputs::deliver(args.json.as_deref(), &findings, &text, |written| {
        if let Some(submission) = submission {
            let place = submission.place().to_owned();
            written.note(&place, submission.publish())?;
        }
        match destination {
            Some(destination) => report::write(&destination, &findings, &pictures),
            None => Ok(()),
        }
    })
}

/// Finds out before any computing whether the outputs can be written, and begins the folders among them.
fn check_outputs(args: &Args) -> Result<(Option<Destination<'_>>, Option<Submission>)> {
    let destination = args.report.as_deref().map(Destination::check).transpose()?;
    let submission = match args.submission.as_deref() {
        Some([dir, method]) => {
            let names = args.dirs.iter().map(|dir| folder::name(dir)).collect::<Vec<_>>();
            let fill = args.method.method()?.refinement.fill;
            Some(Submission::new(Path::new(dir), method, &names, fill)?)
        }
        _ => None,
    };
    let report = destination.as_ref().map(|report| ("--report", report.place()));
    let submitted = submission.as_ref().map(|submission| ("--submission", submission.place()));
    if let (Some(report), Some(submitted)) = (report, submitted) {
        outputs::outside(report, submitted)?;
        outputs::outside(submitted, report)?;
    }
    if let Some(path) = outputs::json_file(args.json.as_deref()) {
        write::check_path(path)?;
        for folder in report.into_iter().chain(submitted) {
            outputs::outside(folder, ("--json", path))?;
        }
        let mut inputs: Vec<PathBuf> = args.dirs.iter().flat_map(|dir| folder::inputs(dir)).collect();
        inputs.extend(
            [&args.disparity, &args.truth, &args.mask, &args.method.config].into_iter().flatten().cloned(),
        );
        let inputs: Vec<_> = inputs.iter().map(|path| ("an input", path.as_path())).collect();
        outputs::distinct(&inputs, &[("--json", path)])?;
    }
    Ok((destination, submission))
}

/// The figures of a map that is there already.
fn finished_map(
    map: &Path,
    truth: &Path,
    args: &Args,
    pictures: Option<&mut Vec<Vec<Picture>>>,
) -> Result<Findings> {
    let reader = args.reading.reader();
    let estimate = reader.disparity(map)?;
    let (scale, mask) = (args.truth_scale, args.mask.as_deref());
    let ground = folder::ground_truth(reader, truth, scale, mask, map, estimate.size())?;
    let name = map.file_stem().unwrap_or(map.as_os_str()).to_string_lossy().into_owned();
    let finished = ground.evaluate(&estimate)?;
    if let Some(pictures) = pictures {
        pictures.push(report::pictures(&name, ground.truth(), &estimate, None)?);
    }
    let figures = Figures {
        name,
        raw: None,
        finished,
        breakdown: None,
        confidence: None,
        validity: None,
        seconds: None,
    };
    Ok(Findings::new(None, None, vec![figures]))
}

/// The folders, all complete: what is missing in the last is said before the first is matched.
fn folders(args: &Args) -> Result<Vec<Folder<'_>>> {
    let folders = args.dirs.iter().map(|dir| Folder::of(dir)).collect::<Result<Vec<_>>>()?;
    if args.truth_scale.is_some() && !folders.iter().any(Folder::is_scaled) {
        let reason = "no folder holds a truth of 8 bits, and disp0GT.pfm is in pixels; leave it out";
        return Err(Error::option("--truth-scale", reason));
    }
    Ok(folders)
}

/// Matches every folder by `method`, called `called` where there are several; `see` gets every pair with its maps and their
/// time.
fn match_all(
    args: &Args,
    folders: &[Folder],
    matcher: &mut Matcher,
    method: Method,
    called: Option<&str>,
    mut see: impl FnMut(&Scene, &Maps, Duration) -> Result<()>,
) -> Result<Findings> {
    let mut figures = Vec::new();
    let mut ran_on = None;
    for folder in folders {
        let scene = folder.read(args.reading.reader(), args.truth_scale)?;
        let name = called.map_or(scene.name.clone(), |called| format!("{}, {called}", scene.name));
        let (matched, time) =
            crate::match_and_tell(matcher, &scene.pair, scene.range, &method, Some(&name), false, None)?;
        see(&scene, &matched.maps, time)?;
        let (ground, maps, estimate) = (&scene.ground, &matched.maps, matched.maps.final_map());
        figures.push(Figures {
            raw: Some(ground.evaluate(&maps.raw_map())?),
            finished: ground.evaluate(&estimate)?,
            breakdown: Some(ground.breakdown(&estimate, scene.pair.left())?),
            confidence: Some(ground.sparsify(&estimate, &maps.confidence)?),
            validity: ground.detect(&maps.validity)?,
            name: scene.name,
            seconds: Some(time.as_secs_f64()),
        });
        ran_on = Some(matched.ran_on);
    }
    Ok(Findings::new(Some(method), ran_on, figures))
}

/// Prints the paper's tables beside ours.
fn compare(args: &Args) -> Result<()> {
    let folders = folders(args)?;
    let mut matcher = Matcher::new(&args.execution.execution()?)?;
    let mut found = Vec::new();
    for preset in tables::COMPARED {
        let method = Method::preset(preset)?.validated()?;
        found
            .push((preset, match_all(args, &folders, &mut matcher, method, Some(preset), |_, _, _| Ok(()))?));
    }
    let comparison = Comparison::new(&found);
    outputs::deliver(args.json.as_deref(), &comparison, &comparison.text(), |_| Ok(()))
}

/// Prints what the default is without each of its parts.
fn ablate(args: &Args) -> Result<()> {
    let folders = folders(args)?;
    let mut matcher = Matcher::new(&args.execution.execution()?)?;
    let mut run = |row: &ablations::Row, called: &str| {
        match_all(args, &folders, &mut matcher, ablations::method(row)?, Some(called), |_, _, _| Ok(()))
    };
    // The first run of all prepares what the others find prepared, so its time is not the default's.
    run(&ablations::DEFAULT, "warm-up")?;
    let mut found = Vec::new();
    for row in std::iter::once(&ablations::DEFAULT).chain(ablations::ROWS) {
        found.push((*row, run(row, row.0)?));
    }
    let ablations = Ablations::new(&found);
    outputs::deliver(args.json.as_deref(), &ablations, &ablations.text(), |_| Ok(()))
}
