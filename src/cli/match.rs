//! `mrfgs match`.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use mrfgs::front::check;
use mrfgs::image::{Pair, calib::Calibration, colour, read, write};
use mrfgs::maps::Maps;
use mrfgs::options::{DisparityRange, Fill, MAX_DISPARITY, Schedule};
use mrfgs::plan::Plan;
use mrfgs::solver::Glimpse;
use mrfgs::tiles::Tiles;
use mrfgs::{Error, Matcher, Result};

use super::intermediates::{self, Intermediates};
use super::outputs::{self, Written};
use super::{ExecutionArgs, MethodArgs, bytes, plural};

const EXAMPLES: &str = "\
Examples:
  mrfgs match left.png right.png disparity.pfm --max-disparity 63
  mrfgs match im0.png im1.png disparity.tif                     (with calib.txt beside im0.png)
  mrfgs match l.tif r.tif d.tif --min-disparity -40 --max-disparity 25 --mask clouds.png
  mrfgs match l.png r.png d.png --max-disparity 90 --no-fill --confidence c.png --preview p.png
  mrfgs match l.png r.png d.pfm --max-disparity 255 --dry-run   (levels and memory, without running)";

/// Match a rectified pair and write its disparity map
///
/// LEFT is the reference view; all maps have its size. Images are PNG, JPEG, PNM, TIFF or PFM, told apart by their
/// content; pixels that are transparent or not finite are ignored.
///
/// The extension of OUTPUT says how disparities (in pixels) are stored: .pfm as float with +infinity for invalid pixels,
/// .tif or .tiff as float with NaN, .png as 16 bits with disparity times 256 and 0 for invalid ones (ranges within 0 to
/// 255 only).
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Left image, the reference view
    left: PathBuf,
    /// Right image, of the same size and rectified, so that matches are on the same row
    right: PathBuf,
    /// Disparity map to write: .pfm, .tif, .tiff or .png
    output: PathBuf,

    /// Largest disparity to search, in pixels, itself included; `auto` takes the range from sparse matches [default: ndisp
    /// - 1 of a calib.txt beside LEFT, else auto]
    #[arg(long, value_name = "N|auto", allow_negative_numbers = true, value_parser = pixels_or_auto)]
    max_disparity: Option<Largest>,
    /// Smallest disparity to search, in pixels; may be negative [default: 0, or that of the range found]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = pixels)]
    min_disparity: Option<i32>,
    /// Image of the size of LEFT: where it is not black, LEFT is ignored and the maps are invalid
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
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
    execution: ExecutionArgs,

    /// Writes the map before post-processing too, as OUTPUT by extension
    #[arg(long, value_name = "FILE", help_heading = "More outputs")]
    raw: Option<PathBuf>,
    /// Writes the confidence too: 8-bit PNG, 0 to 255, how far the best rival is behind in 1/8 nat
    #[arg(long, value_name = "FILE", help_heading = "More outputs")]
    confidence: Option<PathBuf>,
    /// Writes why each pixel is what it is: 8-bit PNG, the sum of 1 match outside the right image, 2 occluded, 4 in a
    /// small region, 8 low confidence, 16 filled, 32 masked; 0 is measured and trusted
    #[arg(long, value_name = "FILE", help_heading = "More outputs")]
    validity: Option<PathBuf>,
    /// Writes every step as a picture or a small table into a new folder: corrected images, zones, matches, supports, costs,
    /// graphs, a map for each level, the change of each iteration. Takes a multiple of the time
    #[arg(long, value_name = "DIR", help_heading = "More outputs")]
    intermediates: Option<PathBuf>,
    /// Writes the map in colours too, far cold and near warm, with a scale: PNG
    #[arg(long, value_name = "FILE", help_heading = "More outputs")]
    preview: Option<PathBuf>,
}

fn pixels(text: &str) -> std::result::Result<i32, String> {
    text.parse().map_err(|_| format!("give a whole number of pixels within {MAX_DISPARITY} of 0"))
}

/// The largest disparity to search.
#[derive(Clone, Copy)]
enum Largest {
    Auto,
    Pixels(i32),
}

fn pixels_or_auto(text: &str) -> std::result::Result<Largest, String> {
    if text == "auto" { Ok(Largest::Auto) } else { pixels(text).map(Largest::Pixels) }
}

pub(super) fn run(args: &Args) -> Result<()> {
    let mut method = args.method.method()?;
    if args.no_fill {
        method.fill = Fill::None;
    }
    let execution = args.execution.execution()?;
    let pair = read::pair(&args.left, &args.right, args.mask.as_deref())?;
    let range = range(args, &pair)?;
    check_outputs(args, range)?;
    if !args.quiet {
        for warning in check::warnings(&pair, Some(range)) {
            super::say(&format!("warning: {warning}"));
        }
    }
    if args.dry_run {
        let plan = Plan::new(pair.size().0, pair.size().1, range, &method)?;
        return super::print(&describe(&Tiles::new(&plan)?));
    }
    let mut matcher = Matcher::new(&execution)?;
    let Some(folder) = &args.intermediates else {
        let (matched, _) =
            super::match_and_tell(&mut matcher, &pair, range, &method, None, args.quiet, None)?;
        // Outputs take memory too.
        drop((matcher, pair));
        return write_outputs(args, range, &matched.maps, None);
    };
    let plan = Plan::new(pair.size().0, pair.size().1, range, &method)?;
    let mut steps = Intermediates::new(folder, plan)?;
    let mut look = |glimpse: &mut Glimpse| steps.look(glimpse);
    let (matched, _) =
        super::match_and_tell(&mut matcher, &pair, range, &method, None, args.quiet, Some(&mut look))?;
    write_outputs(args, range, &matched.maps, Some(steps))
}

/// The range to search.
fn range(args: &Args, pair: &Pair) -> Result<DisparityRange> {
    let min = args.min_disparity.unwrap_or(0);
    let range = match args.max_disparity {
        Some(Largest::Pixels(max)) => DisparityRange::new(min, max)?,
        Some(Largest::Auto) => found_range(args, pair)?,
        None => match beside(&args.left, min)? {
            Some(range) => range,
            None => found_range(args, pair)?,
        },
    };
    let width = i64::from(u32::try_from(pair.size().0).unwrap_or(u32::MAX));
    if i64::from(range.min) >= width || i64::from(range.max) <= -width {
        let reason = format!(
            "no disparity from {} to {} is inside images {width} pixels wide; give those of the pair",
            range.min, range.max
        );
        return Err(Error::option("--max-disparity", reason));
    }
    Ok(range)
}

/// The range of the sparse matches.
fn found_range(args: &Args, pair: &Pair) -> Result<DisparityRange> {
    let found = check::range(pair).ok_or_else(|| {
        let reason = "give the largest disparity to search, in pixels: there are too few matches to find it";
        Error::option("--max-disparity", reason)
    })?;
    let range = DisparityRange::new(args.min_disparity.unwrap_or(found.min), found.max)?;
    if !args.quiet {
        let (min, max) = (range.min, range.max);
        super::say(&format!("disparities {min} to {max}, by sparse matches; --max-disparity says otherwise"));
    }
    Ok(range)
}

/// The range that a calib.txt beside the left image gives.
fn beside(left: &Path, min: i32) -> Result<Option<DisparityRange>> {
    match Calibration::beside(left)? {
        Some(calibration) => super::calibrated_range(&left.with_file_name("calib.txt"), &calibration, min),
        None => Ok(None),
    }
}

/// Finds out before any computing whether all outputs can be written.
fn check_outputs(args: &Args, range: DisparityRange) -> Result<()> {
    fn given<'a>((name, path): (&'static str, Option<&'a PathBuf>)) -> Option<(&'static str, &'a Path)> {
        Some((name, path?))
    }
    let maps = [("OUTPUT", Some(&args.output)), ("--raw", args.raw.as_ref())];
    let pictures = [
        ("--confidence", args.confidence.as_ref()),
        ("--validity", args.validity.as_ref()),
        ("--preview", args.preview.as_ref()),
    ];
    args.intermediates.as_deref().map_or(Ok(()), intermediates::check)?;
    for (_, path) in maps {
        path.map_or(Ok(()), |p| write::check_disparity_path(p, range.min, range.max))?;
    }
    for (_, path) in pictures {
        path.map_or(Ok(()), |p| write::check_png_path(p))?;
    }
    let inputs = [
        ("LEFT", Some(&args.left)),
        ("RIGHT", Some(&args.right)),
        ("the mask", args.mask.as_ref()),
        ("the config file", args.method.config.as_ref()),
    ];
    outputs::distinct(
        &inputs.into_iter().filter_map(given).collect::<Vec<_>>(),
        &maps
            .into_iter()
            .chain(pictures)
            .chain([("--intermediates", args.intermediates.as_ref())])
            .filter_map(given)
            .collect::<Vec<_>>(),
    )
}

/// Writes all outputs or leaves none of them.
fn write_outputs(
    args: &Args,
    range: DisparityRange,
    maps: &Maps,
    steps: Option<Intermediates>,
) -> Result<()> {
    let map = maps.final_map();
    let mut written = Written::default();
    written.note(&args.output, write::disparity(&args.output, &map))?;
    if let Some(path) = &args.raw {
        written.note(path, write::disparity(path, &maps.raw_map()))?;
    }
    if let Some(path) = &args.confidence {
        written.note(path, write::grey8(path, &maps.confidence))?;
    }
    if let Some(path) = &args.validity {
        written.note(path, write::grey8(path, &maps.validity))?;
    }
    if let Some(path) = &args.preview {
        let picture = colour::preview(&map, range.min as f32, range.max as f32);
        written.note(path, write::rgb8(path, &picture))?;
    }
    steps.map_or(Ok(()), Intermediates::finish)?;
    written.keep();
    Ok(())
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
            0 if plan.method.schedule == Schedule::CoarseFirst => "level 0, the others in between".into(),
            z => format!("levels {z} to {last}"),
        };
        let (n, head) = (phase.iterations, if i == 0 { "schedule" } else { "" });
        let _ = writeln!(out, "{head:10} {n:>4} iteration{} of {levels}", plural(n as usize));
    }
    if plan.method.tolerance > 0.0 {
        let sooner = match plan.method.schedule {
            Schedule::Together => "or fewer",
            Schedule::CoarseFirst => "or fewer of the last",
        };
        let tolerance = plan.method.tolerance;
        let _ = writeln!(out, "{:10} {sooner}, once the map changes by at most {tolerance} px (RMS)", "");
    }
    out
}
