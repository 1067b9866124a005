//! `mrfgs sequence`.

mod kind;
mod pipeline;
mod writer;

use std::path::{Path, PathBuf};

use mrfgs::error::Reason;
use mrfgs::image::write;
use mrfgs::low_level::plan::Plan;
use mrfgs::options::DisparityRange;
use mrfgs::rectification::Rectification;
use mrfgs::region::Region;
use mrfgs::sigma::Sigma;
use mrfgs::steady::Steady;
use mrfgs::{Error, Matcher};

use crate::args::{
    CameraArgs, CameraNeed, CropArgs, ExecutionArgs, MethodArgs, PRIOR_TOPIC, PriorArgs, PriorTopicArgs,
    PriorView, ReadingArgs, RecordingArgs, RectificationArgs, RegionArgs, Search, Sign,
};
use crate::failure::{Failure, Result};
use crate::outputs::messages::Messages;
use crate::outputs::{Also, Cameras, Files, MapArgs, files, is_printed};
use crate::pairs::folder::CALIBRATION;
use crate::pairs::input::{Calib, Input};
use crate::sequences::known::{self, FramePriors};
use crate::sequences::{FramePair, Frames, Layout, Pairing, RawFrames, Recorded, Rectifier, raw_frames};
use crate::{console, ffmpeg, plan, stop};

use kind::Kind;
use pipeline::Pipeline;
use writer::{Records, Writer};

const EXAMPLES: &str = "\
Examples:
  mrfgs sequence left right maps --max-disparity 127
  mrfgs sequence 'cam/*_L.png' 'cam/*_R.png' maps --method fast
  mrfgs sequence left.mp4 right.mp4 disparity.mp4 --method fast
  # Frames with both views, as a film:
  mrfgs sequence pairs depth.y4m --layout top-bottom --colours viridis
  # A stream from ffmpeg -pix_fmt yuv444p -f yuv4mpegpipe, matched and played:
  mrfgs sequence - - --method fast --max-disparity 63 | ffplay -
  # A ROS recording that contains the calibration:
  mrfgs sequence drive.mcap maps --also depth-mm
  mrfgs sequence drive.mcap found.mcap --also depth,points
  # With the lidar of the recording, and where it stands:
  mrfgs sequence drive.mcap maps --prior-topic /lidar --prior-pose t.txt
  # Shown live in Foxglove:
  mrfgs sequence drive.mcap ws://localhost:8765 --also depth,points
  # With the scans of a lidar, one per frame, and where it stands:
  mrfgs sequence left right maps --calib c --prior scans --prior-pose t.txt
  # Cameras that stand still:
  mrfgs sequence left.mp4 right.mp4 disparity.mp4 --prior last
  # Cameras that move, with their poses:
  mrfgs sequence left right maps --calib c --prior last --prior-pose poses.txt
  # Raw images and a calibration, with depth in millimetres:
  mrfgs sequence left right maps --rectify --calib c.yml --also depth-mm";

/// The flag `--prior` of sequences.
const PRIOR: &str = "Disparities that are known: a file for all frames, a folder with a file per frame, or `last` for the frame before";
const PRIORS: &str = "\
A file of a folder belongs to the frame that has its name, up to the extension; frames without a file have no prior. Files are as for `mrfgs \
match`. With `last`, the disparities measured in a frame are known in the next: for cameras that stand still, whose maps then flicker less. \
Frames are then matched one after another. If the cameras move, --prior-pose gives their poses.";

/// The flag `--prior-pose` of sequences.
const PRIOR_POSE: &str = "Where point clouds come from: the rotation and translation that take their points into the frame of the left \
camera. With --prior last, the way of the left camera";
const PRIOR_POSES: &str = "\
For clouds, a text with 12 or 16 numbers, the rows of [R T]; entries R and T in YAML, JSON or as in KITTI's `calib_velo_to_cam.txt`; KITTI's \
`Tr_velo_to_cam` or Tr; or COLMAP's images.txt, whose first image is the left one.

With `--prior last`, a line for each frame, in their order: the pose of the left camera in the world, as it took the image. Lines are those of \
KITTI's `poses.txt` (12 numbers, the rows of [R T]) or of TUM's trajectories (`time tx ty tz qx qy qz qw`). T has the unit of the baseline, or \
of --prior-unit.";

/// Match the frames of a video
///
/// LEFT and RIGHT are each a folder of images, a file name pattern ('left/*.png', left/%04d.png), a film (MP4, Matroska, AVI; needs
/// ffmpeg), a YUV4MPEG2 stream (ffmpeg's -f yuv4mpegpipe), or - for a stream on standard input. Images are ordered by the numbers in their
/// names, and images of the two cameras with the same number form a pair (--pairing). Without RIGHT each frame holds both views (--layout).
/// All frames must have the same size.
///
/// LEFT alone may also be a ROS recording: an MCAP file, the folder or .db3 of a ROS 2 bag, or a .bag of ROS 1. Its images are paired by
/// the times in their headers, which also name the frames. Images on topics such as `image_rect` count as rectified; others are rectified
/// with the `camera_info` beside them.
///
/// OUTPUT is a folder, a film (NAME.y4m, - for Y4M on standard output, and with ffmpeg NAME.mp4, .mkv, .mov, .webm or .avi), a ROS 2
/// recording (NAME.mcap) or an address for Foxglove (`ws://HOST:PORT`). A folder gets a map per frame, named after the left image (streams:
/// 000000 and so on), and the --also outputs. A film shows the maps in colours with a colour bar; with --also side-by-side, LEFT is beside
/// them. A recording has disparities on /disparity, and with --also depth, depth-mm, depth-registered, points, confidence or validity those
/// too, with the times of the left images. Foxglove shows the same messages while frames are matched; a slow viewer gets the newest.
///
/// Without --max-disparity the range is that of the calibration, or estimated from the first frame. Offset rows, blur and noise are measured
/// on every 30th frame, and corrected alike in the frames between (--set measure-every=N). Reading, rectifying, matching and
/// writing run at the same time; the CPU path matches as many frames at once as it has threads and --memory allows. After an error or
/// Ctrl-C, the maps of all earlier frames are complete.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES, allow_missing_positional = true)]
#[command(mut_arg("prior", |arg| arg.help(PRIOR).long_help(format!("{PRIOR}\n\n{PRIORS}"))))]
#[command(mut_arg("prior_pose", |arg| arg.help(PRIOR_POSE).long_help(format!("{PRIOR_POSE}\n\n{PRIOR_POSES}"))))]
#[allow(clippy::struct_excessive_bools, reason = "each is a flag")]
pub(crate) struct Args {
    /// Frames of the left camera, or frames with both views
    left: PathBuf,
    /// Frames of the right camera
    right: Option<PathBuf>,
    /// Folder for the maps, film (NAME.y4m, NAME.mp4 or -), recording (NAME.mcap), or address for Foxglove (`ws://localhost:8765`)
    #[arg(required = true)]
    output: PathBuf,

    /// How images of LEFT and RIGHT are paired [default: number]
    #[arg(long, value_enum, value_name = "WHICH")]
    pairing: Option<Pairing>,
    /// How both views share a frame, without RIGHT [default: side-by-side]
    #[arg(long, value_enum, value_name = "WHICH")]
    layout: Option<Layout>,
    /// Size and format of a raw stream (ffmpeg: -f rawvideo), such as 1280x480,gray; formats are gray, gray16le, rgb24 and bgr24
    #[arg(long, value_name = "SIZE,FORMAT", value_parser = raw_frames)]
    raw_frames: Option<RawFrames>,
    #[command(flatten)]
    recording: RecordingArgs,
    #[command(flatten)]
    search: Search,
    #[command(flatten)]
    region: RegionArgs,
    /// Calibration, for the range (ndisp of a calib.txt) and for depth and points, as for `mrfgs match` [default: a calib.txt beside the
    /// left images, or that of the recording]
    #[arg(long, value_name = "FILE")]
    calib: Vec<PathBuf>,
    #[command(flatten)]
    crop: CropArgs,
    #[command(flatten)]
    numbers: CameraArgs,
    /// Mask of the size of a left frame: pixels that are not black are ignored in all frames
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
    /// Rectifies raw frames first, with --calib
    #[arg(long, requires = "calib")]
    rectify: bool,
    #[command(flatten)]
    rectification: RectificationArgs,
    /// Steadies still surfaces: where the image does not change, disparities are averaged with earlier frames, weighted by confidence.
    /// Confidence, validity, raw and the right view's map are not averaged
    #[arg(long)]
    steady: bool,
    /// Corrects the frames if their matches show that the right camera has turned since the calibration. Without it, you are only told
    #[arg(long)]
    recalibrate: bool,
    /// Checks everything up to the first frame and prints its plan (levels, schedule, memory), but matches and writes nothing
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    reading: ReadingArgs,
    /// Prints errors only
    #[arg(long)]
    quiet: bool,

    // Each of these has a heading in the help, under which all that follows would stand.
    #[command(flatten)]
    maps: MapArgs,
    /// Writes a line of JSON per frame: `frame` (its name), the fields of `match --json` with `seconds` since the first frame, and with
    /// known cameras `turned`, how far the right camera has turned up, right and clockwise since the calibration, in degrees. `-` prints
    /// them
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    prior: PriorArgs,
    #[command(flatten)]
    prior_topic: PriorTopicArgs,
    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    execution: ExecutionArgs,
}

impl Args {
    /// The paths for the records.
    fn files(&self, input: &Input) -> Files {
        let path = |path: &Path| path.display().to_string();
        Files {
            left: path(&self.left),
            right: path(self.right.as_deref().unwrap_or(&self.left)),
            mask: self.mask.as_deref().map(path),
            calibration: input.calibration_files(),
            prior: self.prior.file().map(path).or_else(|| self.prior_topic.prior_topic.clone()),
            output: Some(path(&self.output)),
        }
    }
}

/// Extensions of films that are not supported as output.
const OTHER_FILMS: [&str; 4] = ["mpg", "mpeg", "wmv", "gif"];

pub(crate) fn run(args: &Args) -> Result<()> {
    let execution = args.execution.execution();
    let kind = Kind::of(&args.output);
    check_flags(args)?;
    if kind == Kind::Film {
        args.maps.also.check_film()?;
    } else if kind.takes_messages() {
        args.maps.also.check_messages("give a folder as OUTPUT")?;
    }
    stop::listen();
    let recorded = open_recording(args)?;
    let texts = recorded.as_ref().map(|recorded| calibration_of(recorded, args)).transpose()?.flatten();
    // Unrectified images of a recording are rectified by the calibration in it.
    let rectify = args.rectify || texts.is_some() && recorded.as_ref().is_some_and(|one| !one.is_rectified());
    if kind == Kind::Folder {
        args.maps.also.check(rectify, false)?;
    }
    let third = args.maps.also.third()?;
    let mut method = args.maps.also.made_by(args.method.method()?)?;
    if args.recalibrate {
        // A correction also changes the faults that are left in the frames.
        method.front.measure_every = 1;
    }
    let rectifying = args.rectification.options_if(rectify)?;
    let remarks = recorded.as_ref().map(Recorded::remarks);
    let mut frames = match recorded {
        Some(recorded) => masked(Frames::of_recording(recorded), args)?,
        None => open(args)?,
    };
    if rectify {
        frames = frames.taken_raw();
    }
    let first_image = frames.first_image().map(Path::to_owned);
    check_outputs(args, &frames, first_image.as_deref())?;
    let rate = frames.rate();
    let films: Vec<_> = frames.films().map(|(film, complaint)| (film.to_owned(), complaint)).collect();
    // The first frame determines the range, and the size that all later frames must have.
    let (first, frames) = pipeline::patiently(move || (frames.next(), frames))?;
    let FramePair { name, header, cloud, pair } =
        first.ok_or_else(|| Error::read(&args.left, "contains no frame"))??;
    let sign = Sign::default();
    let cameras = args.maps.also.take_cameras();
    let prior_need = known::need(&args.prior, &args.prior_topic)?;
    let takes_rig = takes_cameras(args) || prior_need.is_some();
    let beside = first_image
        .as_deref()
        .filter(|_| takes_rig || kind.takes_messages() || args.search.takes_calibration());
    let numbers = Some(&args.numbers);
    let calib = texts.as_deref().map_or(Calib::Files(&args.calib, &args.crop), Calib::Texts);
    let mut input = Input::new(pair, &args.search, sign, calib, numbers, rectifying.as_ref(), beside)?;
    if let Some(by) = &mut input.rectification {
        by.keep_places()?;
    }
    if args.recalibrate && input.calibration().is_none() {
        let reason = "needs camera values; add --calib, or --focal and --baseline, or remove it";
        return Err(Failure::usage("--recalibrate", reason));
    }
    if !args.quiet {
        input.say_range(sign, " of the first frame");
    }
    // Messages with cameras and --recalibrate use a calibration if there is one, but do not require all of it.
    let need = CameraNeed::strictest([cameras.map(Also::need), prior_need]);
    let known = if need.is_none() && (kind.takes_messages() || args.recalibrate) {
        None
    } else {
        input.rig(need.as_ref(), first_image.as_deref().unwrap_or(&args.left))?
    };
    let mut rig = known.filter(|_| cameras.is_some());
    if let (Some(word), Some(rig)) = (cameras.filter(|_| kind.takes_messages()), &rig) {
        word.check_metres(rig)?;
    }
    let part = args.region.roi.as_ref();
    let region = part.map(|part| input.region(part)).transpose()?;
    if let Some(part) = part {
        rig = rig.map(|rig| rig.of_part(part.x.start, part.y.start));
    }
    if !args.quiet {
        input.warn(region.as_ref());
    }
    let view = PriorView { size: input.pair.size(), sign, rig: input.as_taken(known) };
    let window = region.as_ref().map(|region| region.window().clone());
    let priors = FramePriors::new(&args.prior, &args.prior_topic, view, window)?;
    if args.dry_run {
        let (width, height) = region.as_ref().map_or(input.pair.size(), |region| region.window().size());
        let plan = Plan::new(width, height, input.range, &method)?
            .with_prior(args.prior.file().is_some() || args.prior_topic.prior_topic.is_some());
        return Ok(console::print(&plan::describe(&plan)?)?);
    }
    let sigma = Sigma::for_method(&method);
    let mut matcher = Matcher::builder().method(method).execution(execution).build()?;
    let range = range_of_all(&mut matcher, &input, args)?;
    let rectifying = input.rectifying();
    let (output, wanted, steady) = (args.output.as_path(), &args.maps, args.steady.then(Steady::new));
    let writer = Writer { output, wanted, range, rig, sigma, rectifying, third, rate, steady };
    let records = args.json.as_deref().map(Records::new).transpose()?;
    let origin = part.map_or((0, 0), |part| (part.x.start, part.y.start));
    let messages = || {
        let cameras = input.calibration().and_then(|calibration| Cameras::of(calibration, origin));
        Messages::new(range, cameras, args.maps.also.framed(third.as_ref()))
    };
    let mut sink = match (kind, kind::address(output)) {
        (Kind::Viewer, Some(address)) => {
            let (sink, address) = writer.begin_viewer(address, messages(), records)?;
            if !args.quiet {
                console::say(&format!("open {address} in Foxglove"));
            }
            sink
        }
        (Kind::Film, _) => writer.begin_film(records),
        (Kind::Recording, _) => writer.begin_recording(messages(), records)?,
        _ => writer.begin_folder(records)?,
    };
    let files = args.files(&input);
    let (rectified, size) = (rectify, input.pair.size());
    let region = part.map(|part| Region::new(part.clone(), size, range)).transpose()?;
    let recalibrate = args.recalibrate;
    let pipeline = Pipeline { matcher, range, region, files, rectified, recalibrate, quiet: args.quiet };
    let known = input.calibration().and_then(|known| Rectification::of_rectified(known, size).ok());
    let rectifier = Rectifier::new(input.rectification, known, range, recalibrate);
    let first = FramePair { name, header, cloud, pair: input.pair };
    let ended = pipeline.run(first, frames, rectifier, priors, &mut sink);
    if !args.quiet {
        for (film, complaint) in &films {
            if let Some(said) = complaint.said() {
                console::say(&format!(
                    "warning: {}: some frames may be damaged; ffmpeg says: {said}",
                    film.display()
                ));
            }
        }
        if let Some(said) = remarks.and_then(|remarks| remarks.said()) {
            console::say(&said);
        }
    }
    ended
}

/// Opens LEFT if it is a recording.
fn open_recording(args: &Args) -> Result<Option<Recorded>> {
    let (left, reader) = (args.left.clone(), args.reading.reader());
    let (recording, clouds) = (&args.recording, args.prior_topic.prior_topic.as_deref());
    let is_one = !is_printed(&left) && Recorded::is(&left);
    if !is_one {
        let flags = [
            ("--topics", recording.topics.is_some()),
            ("--tolerance", recording.tolerance.is_some()),
            (PRIOR_TOPIC, clouds.is_some()),
        ];
        return match flags.into_iter().find(|(_, given)| *given) {
            Some((flag, _)) => {
                Err(Failure::usage(flag, "only applies to a recording, but LEFT is not one; remove it"))
            }
            None => Ok(None),
        };
    }
    let reason = "does not apply to a recording, which contains both views; remove it";
    for (flag, given) in [
        ("RIGHT", args.right.is_some()),
        ("--layout", args.layout.is_some()),
        ("--pairing", args.pairing.is_some()),
        ("--raw-frames", args.raw_frames.is_some()),
    ] {
        if given {
            return Err(Failure::usage(flag, reason));
        }
    }
    let (recording, clouds) = (recording.clone(), clouds.map(str::to_owned));
    let opened = pipeline::patiently(move || Recorded::open(&left, &recording, clouds.as_deref(), reader))??;
    Ok(Some(opened))
}

/// The recorded calibration, unless the user gives one or it is not needed.
fn calibration_of(recorded: &Recorded, args: &Args) -> Result<Option<Vec<(PathBuf, String)>>> {
    if !args.calib.is_empty() || args.numbers.flag().is_some() {
        return Ok(None);
    }
    let found = recorded.calibration()?;
    let (topic, beside) = recorded.left_topic();
    if found.is_some() {
        // Disparities of rectified images need no cameras, so faults in the calibration do not matter then.
        let takes_cameras = takes_cameras(args) || args.search.takes_cameras().is_some();
        let counts = !recorded.is_rectified() || takes_cameras || Kind::of(&args.output).takes_messages();
        return Ok(found.filter(|_| counts));
    }
    let path = recorded.path().display();
    if let Some(word) = args.maps.also.take_cameras().filter(|word| !word.need().optional) {
        let reason = format!(
            "needs camera values, but {path} lacks a calibration of both cameras (on topics such as {beside}); add --calib, or --focal and \
             --baseline"
        );
        return Err(Failure::usage(word.flag(), reason));
    }
    if recorded.is_raw() {
        let reason = format!(
            "{topic} is not rectified, and there is no calibration of both cameras on topics such as {beside}; add --rectify and both \
             files with --calib, or if it is in fact rectified, --calib or --focal and --baseline"
        );
        return Err(Error::read(recorded.path(), reason).into());
    }
    if !recorded.is_rectified() && !args.quiet {
        console::say(&format!(
            "{topic} is assumed to be rectified, as there is no calibration of both cameras on topics such as {beside}"
        ));
    }
    Ok(None)
}

/// Whether the cameras are needed.
fn takes_cameras(args: &Args) -> bool {
    args.maps.also.take_cameras().is_some() || args.recalibrate
}

/// The range for all frames. If it was estimated, a match of the first frame shows whether it must be wider.
fn range_of_all(matcher: &mut Matcher, first: &Input, args: &Args) -> Result<DisparityRange> {
    // The folder may not exist yet; only the format matters here.
    let searched = first.searched(|wider| args.maps.check(Path::new(""), "000000", wider).is_ok());
    if !searched.may_widen {
        return Ok(first.range);
    }
    let searched = searched.in_region(args.region.roi.as_ref());
    let matched = searched.job(matcher, &first.pair).on_progress(|_| stop::go_on()).run()?;
    if !args.quiet {
        first.say_wider(&matched, Sign::default(), " of the first frame");
    }
    Ok(matched.range())
}

/// Refuses flags without effect and unsupported film formats.
fn check_flags(args: &Args) -> Result<()> {
    if args.layout.is_some() && args.right.is_some() {
        let reason = "only applies to frames with both views, but RIGHT is given; remove one of them";
        return Err(Failure::usage("--layout", reason));
    }
    let kind = Kind::of(&args.output);
    if args.maps.format.is_some() && kind != Kind::Folder {
        let reason = format!(
            "only applies to maps in a folder, but OUTPUT is {}; remove it, or give a folder as OUTPUT",
            kind.name()
        );
        return Err(Failure::usage("--format", reason));
    }
    let extension = args.output.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if OTHER_FILMS.contains(&extension.as_str()) && !args.output.is_dir() {
        let reason = format!(
            ".{extension} is not supported; use NAME.mp4 or NAME.y4m, or pipe through ffmpeg: mrfgs sequence ... - | ffmpeg -i - {}",
            args.output.display()
        );
        return Err(Failure::usage("OUTPUT", reason));
    }
    Ok(())
}

/// Opens the frames that the arguments name.
fn open(args: &Args) -> Result<Frames> {
    let (left, right) = (args.left.as_path(), args.right.as_deref());
    if is_printed(left) && right.is_some_and(is_printed) {
        let reason = "standard input carries one stream; read one camera from elsewhere, or put both views \
                      into one stream";
        return Err(Failure::usage("RIGHT", reason));
    }
    let (left, right) = (left.to_owned(), right.map(Path::to_owned));
    let (pairing, layout) = (args.pairing.unwrap_or_default(), args.layout.unwrap_or_default());
    let (raw, reader) = (args.raw_frames, args.reading.reader());
    let open = move || Frames::open(&left, right.as_deref(), pairing, layout, raw, reader);
    let mut frames = pipeline::patiently(open)??;
    frames = masked(frames, args)?;
    if !args.quiet {
        frames.films().for_each(|(film, _)| console::say(&format!("ffmpeg decodes {}", film.display())));
    }
    if args.pairing.is_some() && !frames.are_images_of_two() {
        return Err(Failure::usage(
            "--pairing",
            "only applies to image files of two cameras, LEFT and RIGHT; remove it",
        ));
    }
    if args.raw_frames.is_some() && !frames.have_stream() {
        return Err(Failure::usage("--raw-frames", "only applies to streams without a header; remove it"));
    }
    Ok(frames)
}

/// Applies the mask of `--mask`, if given.
fn masked(frames: Frames, args: &Args) -> Result<Frames> {
    match &args.mask {
        Some(mask) => Ok(frames.masked_by(args.reading.reader().mask(mask)?)),
        None => Ok(frames),
    }
}

/// Refuses outputs that overwrite an input, go to a terminal, or are of the wrong kind.
fn check_outputs(args: &Args, frames: &Frames, first_image: Option<&Path>) -> Result<()> {
    let output = args.output.as_path();
    let mut inputs = frames.files();
    let beside = first_image.map(|image| image.with_file_name(CALIBRATION));
    let given = args.mask.iter().chain(&args.calib).chain(&args.maps.also.into).chain(&beside);
    inputs.extend(given.map(PathBuf::as_path));
    inputs.extend(args.prior.inputs().map(|(_, path)| path).filter(|path| path.is_file()));
    let named: Vec<_> = inputs.iter().map(|file| ("an input", *file)).collect();
    files::check_json_path(args.json.as_deref())?;
    if let Some(json) = files::json_file(args.json.as_deref()) {
        files::distinct(&named, &[("OUTPUT", output), ("--json", json)])?;
    }
    if is_printed(output) {
        if args.json.as_deref().is_some_and(is_printed) {
            return Err(Failure::usage("--json", "`-` is already used for the film; give a file name"));
        }
        return Ok(console::check_takes_data()?);
    }
    match Kind::of(output) {
        Kind::Viewer => return Ok(()),
        Kind::Recording => {
            write::check_path(output)?;
            return files::distinct(&named, &[("OUTPUT", output)]);
        }
        Kind::Film => {
            if ffmpeg::writes(output) {
                ffmpeg::check(output)?;
            }
            write::check_path(output)?;
            return files::distinct(&named, &[("OUTPUT", output)]);
        }
        Kind::Folder => {}
    }
    let place = files::folder_place(output)?;
    let inside = |file: &&Path| file.canonicalize().is_ok_and(|file| file.parent() == Some(&place));
    match inputs.iter().find(|file| inside(file)) {
        Some(_) => {
            let reason = Reason::of_request("contains input frames; give another folder");
            Err(Error::write(output, reason).into())
        }
        None => Ok(()),
    }
}
