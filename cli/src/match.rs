//! `mrfgs match`.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use mrfgs::depth::Rig;
use mrfgs::front::check::{self, Warning};
use mrfgs::image::Pair;
use mrfgs::image::calib::Calibration;
use mrfgs::options::{DisparityRange, Fill, Order};
use mrfgs::plan::Plan;
use mrfgs::solver::{Glimpse, Inspector};
use mrfgs::tiles::Tiles;
use mrfgs::{Error, Matcher, Result};

use crate::intermediates::Intermediates;
use crate::match_outputs::{MoreOutputs, Outcome};
use crate::search::{Found, Search};
use crate::sidecar::{Files, Sidecar};
use crate::sign::Sign;
use crate::stop;
use crate::{ExecutionArgs, MethodArgs, ReadArgs, bytes, plural};

const EXAMPLES: &str = "\
Examples:
  mrfgs match left.png right.png disparity.pfm --max-disparity 63
  mrfgs match l.tif r.tif d.tif --min-disparity -40 --max-disparity 25
  mrfgs match l.png r.png d.png --max-disparity 90 --no-fill --confidence c.png
  mrfgs match l.png r.png - --max-disparity 63 | other-program
  # The plan, its memory included, without running:
  mrfgs match l.png r.png d.pfm --max-disparity 255 --dry-run
  # Range and cameras from the calib.txt beside im0.png:
  mrfgs match im0.png im1.png d.pfm --depth z.tif --point-cloud cloud.ply";

/// Match a rectified pair and write its disparity map
///
/// LEFT is the reference view; all maps have its size. Images are PNG, JPEG, PNM, TIFF or PFM, told apart by their
/// content; pixels that are transparent, not finite, or hold no data are ignored.
///
/// The extension of OUTPUT says how disparities (in pixels) are stored: .pfm as float with +infinity for invalid pixels,
/// .tif or .tiff as float with NaN, .png as 16 bits with disparity times 256 and 0 for invalid ones, as KITTI has it (ranges
/// within 0 to 255 only; a disparity of 0 becomes 1/256). `-` writes PFM to standard output. Of a symbolic link the file is
/// written that it leads to.
///
/// Depth and points take the cameras from a calibration file in Middlebury's format: cam0=[f 0 cx; 0 f cy; 0 0 1] (pixels),
/// doffs (cx1 - cx0, pixels) and baseline. Depth is Z = baseline * f / (d + doffs) along the optical axis, in the unit of the
/// baseline (Middlebury: millimetres); where d + doffs is not above 0 there is none.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Left image, the reference view
    left: PathBuf,
    /// Right image, of the same size and rectified, so that matches are on the same row
    right: PathBuf,
    /// Disparity map to write: .pfm, .tif, .tiff or .png, or `-`
    output: PathBuf,

    #[command(flatten)]
    search: Search,
    /// Which way disparities count in the range, OUTPUT and --raw; the Ames Stereo Pipeline takes right-minus-left
    #[arg(long, value_enum, default_value_t, value_name = "WHICH")]
    sign: Sign,
    /// Calibration file: the range (ndisp), and the cameras for depth and points [default: a calib.txt beside LEFT]
    #[arg(long, value_name = "FILE")]
    calib: Option<PathBuf>,
    /// Image of the size of LEFT: where it is not black, LEFT is ignored and the maps are invalid
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
    #[command(flatten)]
    reading: ReadArgs,
    /// Checks everything and prints the plan (levels, schedule, memory), but runs and writes nothing
    #[arg(long)]
    dry_run: bool,
    /// Prints nothing but failures
    #[arg(long, conflicts_with = "timings")]
    quiet: bool,

    #[command(flatten)]
    method: MethodArgs,
    /// Leaves invalid pixels invalid, the same as `--set fill=none`
    #[arg(long, help_heading = "Method")]
    no_fill: bool,

    #[command(flatten)]
    pub(super) execution: ExecutionArgs,

    #[command(flatten)]
    more: MoreOutputs,
}

pub(super) fn run(args: &Args) -> Result<()> {
    stop::listen();
    let mut method = args.method.method()?;
    if args.no_fill {
        method.refinement.fill = Fill::None;
    }
    let execution = args.execution.execution()?;
    let pair = args.reading.reader().pair(&args.left, &args.right, args.mask.as_deref())?;
    let calibration = calibration(args)?;
    let known = calibration.as_ref().map(|(path, calibration)| (path.as_path(), calibration));
    let Found { range, by_matches } = args.search.range(&pair, known, args.sign)?;
    if by_matches && !args.quiet {
        let DisparityRange { min, max } = args.sign.range(range);
        crate::say(&format!("disparities {min} to {max}, by sparse matches; --max-disparity says otherwise"));
    }
    let rig = rig(args, &pair, calibration.as_ref())?;
    let inputs = [
        ("LEFT", Some(&args.left)),
        ("RIGHT", Some(&args.right)),
        ("the mask", args.mask.as_ref()),
        ("the config file", args.method.config.as_ref()),
        ("the calibration file", calibration.as_ref().map(|(path, _)| path)),
    ];
    let inputs = inputs.into_iter().filter_map(|(name, path)| Some((name, path?.as_path())));
    args.more.check(&args.output, &inputs.collect::<Vec<_>>(), args.sign.range(range))?;
    if !args.quiet {
        // A range that was found says nothing of what the user knows.
        warn(check::warnings(&pair, (!by_matches).then_some(range)));
    }
    let plan = Plan::new(pair.size().0, pair.size().1, range, &method)?;
    if args.dry_run {
        return crate::print(&describe(&Tiles::new(&plan)?));
    }
    let mut matcher = Matcher::new(&execution)?;
    let steps = args.more.intermediates.as_deref().map(|folder| Intermediates::new(folder, plan));
    let mut steps = steps.transpose()?;
    let mut look = steps.as_mut().map(|steps| |glimpse: &mut Glimpse| steps.look(glimpse));
    let look: Option<Inspector> = match &mut look {
        Some(look) => Some(look),
        None => None,
    };
    let (matched, time) = crate::match_and_tell(&mut matcher, &pair, range, &method, None, args.quiet, look)?;
    if !args.quiet {
        warn(check::clipped(&matched.maps, range).into_iter().map(|warning| args.sign.warning(warning)));
    }
    // Outputs take memory too.
    drop(matcher);
    let pair = Some(pair).filter(|_| args.more.show_left());
    let path = |path: &Path| path.display().to_string();
    let files = Files {
        left: path(&args.left),
        right: path(&args.right),
        mask: args.mask.as_deref().map(path),
        calibration: calibration.as_ref().map(|(file, _)| path(file)),
        output: path(&args.output),
    };
    let outcome = Outcome {
        left: pair.as_ref().map(Pair::left),
        rig,
        maps: &matched.maps,
        range,
        sign: args.sign,
        sidecar: Sidecar::new(&files, &matched, time, args.sign),
    };
    let said = args.more.write(&args.output, &outcome, steps)?;
    if let Some((file, _)) = calibration.filter(|_| !args.quiet && !said.is_empty()) {
        crate::say(&format!("{said}; unit: that of the baseline in {}", file.display()));
    }
    Ok(())
}

/// A calibration file and what it says.
type Calibrated = (PathBuf, Calibration);

/// The calibration file, where one is asked for or there is a need of it.
fn calibration(args: &Args) -> Result<Option<Calibrated>> {
    if let Some(path) = &args.calib {
        return Ok(Some((path.clone(), Calibration::read(path)?)));
    }
    if args.search.max_disparity.is_some() && args.more.take_cameras().is_none() {
        return Ok(None);
    }
    let found = Calibration::beside(&args.left)?;
    Ok(found.map(|calibration| (args.left.with_file_name("calib.txt"), calibration)))
}

/// The cameras, where depth or points are asked for.
fn rig(args: &Args, pair: &Pair, calibration: Option<&Calibrated>) -> Result<Option<Rig>> {
    let Some(flag) = args.more.take_cameras() else { return Ok(None) };
    let Some((path, calibration)) = calibration else {
        let left = args.left.display();
        let reason =
            format!("takes the cameras, and there is no calib.txt beside {left}; give one with --calib");
        return Err(Error::option(flag, reason));
    };
    let (width, height) = pair.size();
    let size = (calibration.width.unwrap_or(width as u32), calibration.height.unwrap_or(height as u32));
    if size != (width as u32, height as u32) {
        return Err(Error::Mismatch(format!(
            "{} is for images of {} x {} and {} is {width} x {height}: depth takes the calibration of this size",
            path.display(),
            size.0,
            size.1,
            args.left.display()
        )));
    }
    match Rig::new(calibration) {
        Err(Error::Option { reason, .. }) => Err(Error::read(path, reason)),
        rig => rig.map(Some),
    }
}

/// Says on standard error what is probably wrong.
fn warn(warnings: impl IntoIterator<Item = Warning>) {
    for warning in warnings {
        crate::say(&format!("warning: {warning}"));
    }
}

/// The plan for people.
fn describe(tiles: &Tiles) -> String {
    let mut out = String::new();
    let plan = tiles.largest();
    let ((width, height), range) = (tiles.whole().size(), plan.range);
    let _ = writeln!(
        out,
        "{width} x {height} pixels, disparities {} to {} ({} label{})",
        range.min,
        range.max,
        range.labels(),
        plural(range.labels())
    );
    let tiled = tiles.count() > 1;
    if tiled {
        let (width, height) = plan.size();
        let _ =
            writeln!(out, "in {} tiles of up to {width} x {height} pixels, each in its turn", tiles.count());
    }
    out.push('\n');
    let _ = writeln!(out, "level      width x height    labels                  memory");
    for (z, level) in plan.levels.iter().enumerate() {
        let size = format!("{} x {}", level.width, level.height);
        let labels = format!("{} to {} ({})", level.min, level.max(), level.labels);
        let _ = writeln!(out, "{z:>5}  {size:>18}    {labels:20} {:>9}", bytes(plan.level_bytes(z)));
    }
    let _ = writeln!(out, " maps{:>52}", bytes(plan.map_bytes()));
    if tiled {
        let _ = writeln!(out, "whole image{:>46}", bytes(tiles.bytes() - plan.bytes()));
    }
    let _ = writeln!(out, "  all{:>52}\n", bytes(tiles.bytes()));
    let width = 8 * plan.volume_width.bytes();
    let _ = writeln!(out, "messages   {width} bits, factors of {} pixels and their centre", plan.neighbours);
    let last = plan.levels.len() - 1;
    for (i, phase) in plan.phases.iter().enumerate() {
        let levels = match phase.finest {
            z if z == last => format!("level {last}"),
            0 if plan.method.schedule.order == Order::CoarseFirst => "level 0, the others in between".into(),
            z => format!("levels {z} to {last}"),
        };
        let (n, head) = (phase.iterations, if i == 0 { "schedule" } else { "" });
        let _ = writeln!(out, "{head:10} {n:>4} iteration{} of {levels}", plural(n as usize));
    }
    if plan.method.schedule.tolerance > 0.0 {
        let sooner = match plan.method.schedule.order {
            Order::Together => "or fewer",
            Order::CoarseFirst => "or fewer of the last",
        };
        let tolerance = plan.method.schedule.tolerance;
        let _ = writeln!(out, "{:10} {sooner}, once the map changes by at most {tolerance} px (RMS)", "");
    }
    out
}
