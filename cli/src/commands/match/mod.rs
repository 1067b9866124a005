//! `mrfgs match`.

mod in_blocks;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mrfgs::calibration::cameras::ThirdCamera;
use mrfgs::image::{Pair, Rect, pfm, write};
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::program::tiles::Tiles;
use mrfgs::options::{DisparityRange, Execution, Method};
use mrfgs::rectification::Options;
use mrfgs::region::{Blocks, Region};
use mrfgs::sigma::Sigma;
use mrfgs::{Matcher, check};

use crate::args::{
    BlockArgs, CameraArgs, CameraNeed, ExecutionArgs, MethodArgs, PriorArgs, PriorView, RectificationArgs,
    RegionArgs, Sign,
};
use crate::failure::{Failure, Result};
use crate::outputs::{
    Also, AlsoArgs, Files, InFront, MatchRecord, Outcome, View, Written, files, other_sign,
};
use crate::pairs::input::{self, Input, PairArgs, Views};
use crate::pairs::large::{LargePair, PairFiles, UnreadPair};
use crate::{console, matching, plan, stop};

const EXAMPLES: &str = "\
Examples:
  # Two hand-held photos, and the map in colours:
  mrfgs match l.jpg r.jpg d.pfm --rectify --also preview
  # Raw images and a calibration, with depth:
  mrfgs match l.png r.png d.pfm --rectify --calib stereo.yml --also depth
  # Rectified images, with a range of disparities:
  mrfgs match left.png right.png disparity.pfm --max-disparity 63
  mrfgs match l.tif r.tif d.tif --min-disparity -40 --max-disparity 25
  mrfgs match l.png r.png d.png --max-disparity 90 --also confidence
  mrfgs match l.png r.png - --max-disparity 63 | other-program
  # Keep holes where the views disagree:
  mrfgs match l.png r.png d.pfm --max-disparity 90 --set fill=none
  # Print the plan and its memory without running it:
  mrfgs match l.png r.png d.pfm --max-disparity 255 --dry-run
  # Depth, with range and cameras from the calib.txt beside im0.png:
  mrfgs match im0.png im1.png d.pfm --also depth,points
  # Part of a large pair:
  mrfgs match l.tif r.tif d.tif --max-disparity 255 --roi 4000,2500,800,600
  # A pair larger than memory; run it again to resume, and on many machines:
  mrfgs match l.tif r.tif d.tif --max-disparity 255 --blocks job
  # Depth without a calibration file:
  mrfgs match l.png r.png d.pfm --focal 700 --baseline 120mm --also depth
  # Both views in one file of a stereo camera:
  mrfgs match photo.mpo d.pfm --rectify
  # With points of a lidar in the left view, as lines of x,y,disparity:
  mrfgs match l.png r.png d.pfm --max-disparity 90 --prior points.csv
  # With the points of a lidar, and where it stands:
  mrfgs match l.png r.png d.pfm --calib c --prior scan.pcd --prior-pose t.txt
  # Points as LAZ, in the frame of the left camera before rectification:
  mrfgs match l.png r.png d.pfm --rectify --calib c --also points-original.laz";

/// Turn a pair of images into a disparity map
///
/// The map says for each pixel of LEFT how far it moves to the left in RIGHT: LEFT (x, y) with disparity d appears at RIGHT (x - d, y). Near
/// things move farther. Matching points must be in the same row; --rectify sees to that.
///
/// LEFT is the reference view; all maps have its size. Images are PNG, JPEG, PNM, TIFF, BMP, PFM or NPY, whatever their extension.
/// Transparent, non-finite and no-data pixels are ignored.
///
/// The extension of OUTPUT selects how disparities (in pixels) are stored: .pfm as float with +infinity for invalid pixels; .tif or .tiff
/// as float with NaN and the georeference of LEFT; .png as in KITTI, 16 bits with disparity times 256 and 0 for invalid pixels (ranges
/// within 0 to 255 only; a disparity of 0 becomes 1/256). `-` writes PFM to standard output. A symbolic link is followed.
///
/// Depth and points need a calibration: P1 and P2 of OpenCV, the projections of ROS, or Middlebury's cam0=[f 0 cx; 0 f cy; 0 0 1] (pixels),
/// doffs (cx1 - cx0, pixels) and baseline; with --rectify, any that `mrfgs rectify` reads. Depth is Z = baseline * f / (d + doffs) along
/// the optical axis, in the unit of the baseline: metres with ROS and Kalibr, millimetres with Middlebury, the unit of the chessboard with
/// OpenCV. An entry `unit` in the file (mm, cm or m) states it. If d + doffs is 0 or less there is no depth. --focal and --baseline replace
/// a calibration whose doffs is 0.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    #[command(flatten)]
    pair: PairArgs,
    #[command(flatten)]
    region: RegionArgs,
    #[command(flatten)]
    blocks: BlockArgs,
    #[command(flatten)]
    numbers: CameraArgs,
    /// Disparity map to write: .pfm, .tif, .tiff or .png, or `-`
    output: Option<PathBuf>,

    /// Sign convention of disparities, for the range, OUTPUT and --also raw; the Ames Stereo Pipeline uses right-minus-left
    #[arg(long, value_enum, default_value_t, value_name = "WHICH")]
    sign: Sign,
    /// Rectifies raw images first, as `mrfgs rectify` does: with --calib, or without a calibration from matches between the images (then
    /// there is no depth, and a calib.txt beside LEFT is ignored). All outputs belong to the rectified left view
    #[arg(long)]
    rectify: bool,
    #[command(flatten)]
    rectification: RectificationArgs,
    #[command(flatten)]
    prior: PriorArgs,
    /// Checks everything and prints the plan (levels, schedule, memory), but runs and writes nothing
    #[arg(long)]
    dry_run: bool,
    /// Prints errors only
    #[arg(long)]
    quiet: bool,

    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    execution: ExecutionArgs,

    #[command(flatten)]
    also: AlsoArgs,
    /// Writes a record of the match and its result as JSON; `-` prints it
    ///
    /// The fields are `version`, `files` (`left`, `right`, `mask`, `calibration`, `prior`, `output`), `rectified`, `trust` (rectified
    /// without a calibration: `matches`, `agreeing`, `median` and `percentile95` of the row errors in pixels, `coverage` and
    /// `off_one_plane` from 0 to 1), `region` (first column and row in LEFT, with --roi), `width`, `height`, `sign`, `range` (`min`,
    /// `max`), `labels`, `method` (every key), `ran_on`, `driver` (of the device), `note` (why another device was used), `tiles`, `blocks` (with more than one),
    /// `moved_up` (shift of the right view in pixels), `smoothed` (standard deviations for the left and the right view, in pixels), `prior`
    /// (`kind`, `given` and `dropped` pixels, `trust` from 0 to 1; with --prior), `iterations` and `seconds` (of the match). `density` is the share of pixels with a disparity (%), the sum of `measured` and
    /// `filled`. `mean_confidence` averages over measured pixels.
    #[arg(long, value_name = "FILE", help_heading = "More outputs")]
    json: Option<PathBuf>,
}

impl Args {
    fn output(&self) -> &Path {
        self.output.as_deref().expect("`run` has refused a command line without it")
    }
}

/// The command line, checked.
struct Request<'a> {
    args: &'a Args,
    execution: Execution,
    method: Method,
    /// How raw images are rectified, if they are.
    rectifying: Option<Options>,
    /// An output that needs the cameras, if there is one.
    cameras: Option<&'static Also>,
    /// What needs the cameras: an output or a prior.
    need: Option<CameraNeed>,
    /// The camera of `--into`.
    third: Option<ThirdCamera>,
}

impl<'a> Request<'a> {
    fn new(args: &'a Args) -> Result<Self> {
        // First, since it also limits the threads that read the images.
        let execution = args.execution.execution();
        let method = args.also.made_by(args.method.method()?)?;
        let cameras = args.also.take_cameras();
        let rectifying = args.rectification.options_if(args.rectify)?;
        args.also.check(args.rectify)?;
        let third = args.also.third()?;
        let need = cameras.map(Also::need).or_else(|| args.prior.need());
        if args.rectify && args.pair.calib.is_empty() {
            let flag = need.as_ref().map(|need| need.flag.clone());
            let flag = flag.or(args.numbers.flag().map(str::to_owned));
            if let Some(flag) = flag {
                let reason = "without a calibration there is no scale and so no depth; add --calib FILE";
                return Err(Failure::usage(flag, reason));
            }
        }
        Ok(Self { args, execution, method, rectifying, cameras, need, third })
    }

    /// The whole pair.
    fn input(&self) -> Result<Input> {
        let Self { args, need, rectifying, .. } = self;
        args.pair.read(args.sign, need.is_some(), Some(&args.numbers), rectifying.as_ref())
    }

    /// The pair as `views` that are read when needed.
    fn input_of<V: Views>(&self, views: V) -> Result<Input<V>> {
        self.args.pair.of_views(views, self.args.sign, self.need.is_some(), Some(&self.args.numbers))
    }

    /// The files of a pair that can be read by windows; `None` for raw pairs, files with both views and pipes, which are read whole.
    fn files(&self) -> Option<PairFiles<'_>> {
        let pair = &self.args.pair;
        let right = pair.right.as_deref().filter(|_| self.rectifying.is_none())?;
        let files =
            PairFiles { reader: pair.reading.reader(), left: &pair.left, right, mask: pair.mask.as_deref() };
        // What does not exist is reported when it is read.
        let is_pipe = |path: &Path| path.metadata().is_ok_and(|about| !about.is_file());
        let is_any_pipe = [files.left, files.right].into_iter().chain(files.mask).any(is_pipe);
        Some(files).filter(|_| !is_any_pipe)
    }

    /// The folder for files that exist as long as this program needs them.
    fn scratch(&self) -> PathBuf {
        let output = self.args.output();
        if files::is_printed(output) { std::env::temp_dir() } else { files::parent(output).to_owned() }
    }

    /// Whether the pair is matched in blocks: where the user says so, and where a pair of its size does not fit into the memory.
    fn goes_by_blocks(&self) -> Result<bool> {
        if self.args.blocks.blocks.is_some() {
            return Ok(true);
        }
        // Errors of the files are reported when these are read.
        let Some(Ok((width, height))) = self.files().map(|files| files.reader.size(files.left)) else {
            return Ok(false);
        };
        let least = Plan::new(width, height, DisparityRange::new(0, 0)?, &self.method)?;
        Ok(self.args.region.roi.is_none() && Tiles::new(&least).is_err())
    }
}

pub(crate) fn run(mut args: Args) -> Result<()> {
    args.pair.leave(&mut args.output)?;
    if args.output.is_none() {
        return Err(Failure::usage("OUTPUT", "missing; give a file for the map, such as disparity.pfm"));
    }
    stop::listen();
    let request = Request::new(&args)?;
    if args.dry_run
        && let Some(files) = request.files()
    {
        return dry_run(&request, files);
    }
    if request.goes_by_blocks()? {
        return in_blocks::run(&request);
    }
    if let (Some(part), Some(files)) = (&args.region.roi, request.files()) {
        let (input, read) = stop::at_once(|| window_of(&request, files, part))?;
        return run_on(&request, input, read);
    }
    let input = stop::at_once(|| request.input())?;
    let whole = Rect::whole(input.size);
    run_on(&request, input, whole)
}

/// The window of the pair that a match of the region `part` reads, and where it is.
fn window_of(request: &Request, files: PairFiles, part: &Rect) -> Result<(Input, Rect)> {
    let large = LargePair::of_files(files.open(&request.scratch())?, &request.method);
    let input = request.input_of(large)?;
    // A second match may search a wider range.
    let widest = check::beyond(input.range).filter(|_| input.has_found_range()).unwrap_or(input.range);
    input.region(part)?;
    let window = Region::new(part.clone(), input.size, widest)?.window().clone();
    Ok((input.with_views(|large| Ok(large.window(&window)?))?, window))
}

/// Prints the plan of a match, from the headers of the files alone where the range is given.
fn dry_run(request: &Request, files: PairFiles) -> Result<()> {
    let args = request.args;
    let views = UnreadPair::new(files, &request.method, request.scratch())?;
    let input = stop::at_once(|| request.input_of(views))?;
    if !args.quiet {
        input.say_range(args.sign, "");
    }
    let known = input.rig(request.need.as_ref(), &args.pair.left)?;
    let region = args.region.roi.as_ref().map(|part| input.region(part)).transpose()?;
    check_outputs(args, &input)?;
    let view = PriorView { size: input.size, sign: args.sign, rig: input.as_taken(known) };
    let prior = args.prior.read(view)?;
    let (width, height) = region.as_ref().map_or(input.size, |region| region.window().size());
    let plan = Plan::new(width, height, input.range, &request.method)?.with_prior(prior.is_some());
    if args.blocks.blocks.is_none() && Tiles::new(&plan).is_ok() {
        return Ok(console::print(&plan::describe(&plan)?)?);
    }
    let blocks = Blocks::new(input.size, input.range, &request.method)?;
    let mut text = plan::describe_blocks(&blocks, input.range, &request.method)?;
    if let Some((complete, all)) = in_blocks::progress(request, &blocks)? {
        let _ = writeln!(text, "\n{complete} of {all} blocks are complete");
    }
    Ok(console::print(&text)?)
}

/// Matches a pair, or a region of it; `read` is the part of the views that was read.
fn run_on(request: &Request, input: Input, read: Rect) -> Result<()> {
    let Request { args, execution, method, cameras, need, third, .. } = request;
    let range = input.range;
    if !args.quiet {
        input.say_range(args.sign, "");
    }
    let known = input.rig(need.as_ref(), &args.pair.left)?;
    let mut rig = known.filter(|_| cameras.is_some());
    let part = args.region.roi.as_ref();
    part.map(|part| input.region(part)).transpose()?;
    // The region in the pixels that were read.
    let inner = part.map(|part| part.within(&read));
    let region = inner.clone().map(|inner| Region::new(inner, input.pair.size(), range)).transpose()?;
    let also = check_outputs(args, &input)?;
    if !args.quiet {
        input.warn(region.as_ref());
    }
    let (width, height) = region.as_ref().map_or(input.size, |region| region.window().size());
    let view = PriorView { size: input.size, sign: args.sign, rig: input.as_taken(known) };
    let prior = args.prior.read(view)?;
    let prior =
        prior.map(|prior| if read == Rect::whole(input.size) { prior } else { Arc::new(prior.crop(&read)) });
    if args.dry_run {
        let plan = Plan::new(width, height, range, method)?.with_prior(prior.is_some());
        return Ok(console::print(&plan::describe(&plan)?)?);
    }
    let mut matcher = Matcher::builder().execution(execution.clone()).build()?;
    let searched = input.searched(|wider| check_range(args, wider).is_ok());
    let searched = searched.in_region(inner.as_ref()).with_prior(prior.as_ref());
    let (matched, time) = matching::run(&mut matcher, &input.pair, searched, method, None, args.quiet, None)?;
    let range = matched.range();
    let mut pair = input.pair.clone();
    if let Some((part, inner)) = part.zip(inner) {
        pair = pair.crop(&inner);
        rig = rig.map(|rig| rig.of_part(part.x.start, part.y.start));
    }
    if !args.quiet {
        input.say_wider(&matched, args.sign, "");
        input::warn(matched.warnings().into_iter().map(|warning| args.sign.warning(warning)));
    }
    // Free its memory for the outputs.
    drop(matcher);
    let files = record_files(args, &input);
    let unit = input.unit();
    let georeferences = pair.georeferences();
    let is_found = input.has_found_range();
    let rectifying = input.rectifying();
    let trust = input.rectification.as_ref().and_then(|by| by.trust().copied());
    drop(input);
    let pair = Some(pair).filter(|_| args.also.show_left());
    let left = pair.as_ref().map(Pair::left);
    let (maps, sign, sigma) = (&matched.maps, args.sign, Some(Sigma::for_method(method)));
    let outcome = Outcome { maps, range, sign, left, rig, rectifying, third: *third, sigma, georeferences };
    let mut record = MatchRecord::new(&files, &matched, time, args.sign);
    record.rectified = args.rectify;
    record.region = args.region.roi.as_ref().map(|part| [part.x.start, part.y.start]);
    record.trust = trust;
    let said = write_outputs(args, &also, &outcome, &record)?;
    say_end(args, &outcome, is_found, unit.as_deref(), &said);
    Ok(())
}

/// The paths of the match, for a record.
fn record_files<V>(args: &Args, input: &Input<V>) -> Files {
    let prior = args.prior.file().map(|path| path.display().to_string());
    Files { prior, ..args.pair.files(input, Some(args.output())) }
}

/// Prints remarks about the outputs: why they are empty, or what was `said` of each, with the unit of depths.
fn say_end(args: &Args, outcome: &Outcome, is_found: bool, unit: Option<&str>, said: &[String]) {
    if args.quiet {
        return;
    }
    if let Some(why) = empty(args, outcome, is_found) {
        console::say(&format!("warning: {why}"));
    }
    if let Some(unit) = unit.filter(|_| !said.is_empty()) {
        console::say(&format!("{}; unit: {unit}", said.join("; ")));
    }
}

/// Why depths and points come out empty, or nearly so, and what helps. The range may be one that `is_found` by matches.
fn empty(args: &Args, outcome: &Outcome, is_found: bool) -> Option<String> {
    let rig = outcome.rig.as_ref()?;
    let in_front = InFront::of(&outcome.maps.final_map(), rig);
    if in_front.all == 0 {
        let why = "no pixel has a disparity, so there is no depth: check that both images show the same scene, and check the range";
        return Some(why.into());
    }
    let turned = if is_found {
        "the views may be swapped: swap the two images".into()
    } else {
        format!("{}, or swap the two images", other_sign(args.sign))
    };
    let check = "check that the calibration (doffs, baseline) belongs to this pair, and that the range covers what is in front of the cameras";
    in_front.doubt(&turned, check).or_else(|| args.also.left_out(outcome))
}

/// Checks before any computing that all outputs can be written. Returns the files of `--also`.
fn check_outputs<V>(args: &Args, input: &Input<V>) -> Result<Vec<(&'static Also, PathBuf)>> {
    let output = args.output();
    if files::is_printed(output) {
        if let Some(word) = args.also.wanted().next() {
            let reason = "is written beside OUTPUT, but `-` is not a file; give a file as OUTPUT";
            return Err(Failure::usage(word.flag(), reason));
        }
        console::check_takes_data()?;
    }
    check_range(args, input.range)?;
    let also: Vec<_> = args.also.wanted().map(|word| (word, word.beside(output))).collect();
    files::check_json_path(args.json.as_deref())?;
    let mut inputs = args.pair.inputs(input);
    inputs.extend(args.prior.inputs());
    inputs.extend(args.method.files().map(|path| ("the file of --method", path)));
    inputs.extend(args.also.into.as_deref().map(|path| ("the file of --into", path)));
    let flags: Vec<_> = also.iter().map(|(word, path)| (word.flag(), path.as_path())).collect();
    let outputs = std::iter::once(("OUTPUT", output))
        .chain(flags.iter().map(|(flag, path)| (flag.as_str(), *path)))
        .chain(args.json.as_deref().map(|path| ("--json", path)));
    files::distinct(&inputs, &outputs.collect::<Vec<_>>())?;
    Ok(also)
}

/// Checks that the outputs can store disparities of `range`.
fn check_range(args: &Args, range: DisparityRange) -> Result<()> {
    let (output, range) = (args.output(), args.sign.range(range));
    if !files::is_printed(output) {
        write::check_disparity_path(output, range.min, range.max)?;
    }
    Ok(args.also.wanted().try_for_each(|word| word.check(&word.beside(output), range))?)
}

/// Writes all outputs, or none. Returns remarks about depths and points.
fn write_outputs(
    args: &Args,
    also: &[(&Also, PathBuf)],
    outcome: &Outcome,
    record: &MatchRecord,
) -> Result<Vec<String>> {
    let output = args.output();
    let map = || outcome.sign.map(outcome.final_map(args.also.limits));
    let mut written = Written::default();
    let mut said = Vec::new();
    if !files::is_printed(output) {
        written.note(output, outcome.writer(View::Left).disparity(output, &map()))?;
    }
    for (word, path) in also {
        said.extend(written.note(path, args.also.write(word, path, outcome))?);
    }
    // Report each remark once, even if the points are written in several formats.
    said.dedup();
    let json =
        args.json.as_deref().map(|path: &Path| Ok::<_, Failure>((path, files::json_text(path, record)?)));
    let json = json.transpose()?;
    if let Some((path, text)) = json.as_ref().filter(|(path, _)| !files::is_printed(path)) {
        written.note(path, write::save(path, text.as_bytes()))?;
    }
    // Printing cannot be undone, so it comes last.
    if files::is_printed(output) {
        console::print_data(&pfm::encode(&map()), "map")?;
    }
    written.keep();
    if let Some((_, text)) = json.filter(|(path, _)| files::is_printed(path)) {
        console::print(&text)?;
    }
    Ok(said)
}
