//! `mrfgs depth`.

use std::path::PathBuf;

use mrfgs::Error;
use mrfgs::depth::Rig;
use mrfgs::image::Plane;
use mrfgs::image::calib::Calibration;
use mrfgs::maps::Maps;
use mrfgs::options::DisparityRange;

use crate::args::{CameraArgs, CropArgs, ReadingArgs, Sign, disparity, scale};
use crate::console;
use crate::failure::{Failure, Result};
use crate::outputs::{AlsoArgs, InFront, Outcome, Written, files, other_sign};
use crate::pairs::input;

const EXAMPLES: &str = "\
Examples:
  mrfgs depth d.pfm --calib calib.txt
  mrfgs depth scene/truth.pfm here.pfm --calib scene/calib.txt
  mrfgs depth d.pfm --calib stereo.yml --left im0.png --also points.laz
  mrfgs depth d.pfm --calib c --left l.png --also points --clip-depth 30
  mrfgs depth d.png --calib c --confidence d.confidence.png --min-confidence 48";

/// Compute depth and points from an existing disparity map
///
/// MAP is a disparity map in pixels, from this or another program: .pfm, .tif, or 16-bit .png as in KITTI. The outputs are named after MAP
/// or OUTPUT as in `mrfgs match --also`: d.pfm gives d.depth.pfm and d.points.ply. The cameras are those of the rectified pair. Disparities
/// are rounded to 1/256 px.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Disparity map of the left view
    map: PathBuf,
    /// Name that the outputs are derived from, instead of MAP
    output: Option<PathBuf>,
    /// Calibration of the rectified pair, as for `mrfgs match` [default: a calib.txt beside MAP]
    #[arg(long, value_name = "FILE")]
    calib: Vec<PathBuf>,
    #[command(flatten)]
    crop: CropArgs,
    #[command(flatten)]
    numbers: CameraArgs,
    /// Left image, for the colours of points and pictures
    #[arg(long, value_name = "FILE")]
    left: Option<PathBuf>,
    /// Confidence of each pixel, 0 to 255, as written by --also confidence [default: 255]
    #[arg(long, value_name = "FILE")]
    confidence: Option<PathBuf>,
    /// Sign convention of the disparities in MAP
    #[arg(long, value_enum, default_value_t, value_name = "WHICH")]
    sign: Sign,
    /// Grey levels per pixel of disparity, for integers in MAP; level 0 is unknown [default: 256 for 16-bit PNG]
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = scale)]
    scale: Option<f32>,
    #[command(flatten)]
    reading: ReadingArgs,
    /// Prints errors only
    #[arg(long)]
    quiet: bool,
    #[command(flatten)]
    also: AlsoArgs,
}

pub(crate) fn run(args: &Args) -> Result<()> {
    let also = args.also.of_map()?;
    let third = args.also.third()?;
    let output = args.output.as_deref().unwrap_or(&args.map);
    if args.also.limits.takes_confidence() && args.confidence.is_none() {
        let reason = "needs the confidence of each pixel; add --confidence FILE";
        return Err(Failure::usage("--min-confidence", reason));
    }
    if args.also.show_left() && args.left.is_none() {
        return Err(Failure::usage(
            "--left",
            "missing; points and pictures need the colours of the left image",
        ));
    }
    let inputs = [Some(&args.map), args.left.as_ref(), args.confidence.as_ref()].into_iter().flatten();
    let inputs: Vec<_> =
        inputs.chain(&args.calib).chain(&args.also.into).map(|path| ("an input", path.as_path())).collect();
    let outputs: Vec<_> = also.iter().map(|word| (word.flag(), word.beside(output))).collect();
    let named: Vec<_> = outputs.iter().map(|(flag, path)| (flag.as_str(), path.as_path())).collect();
    files::distinct(&inputs, &named)?;
    let reader = args.reading.reader();
    let map = args.sign.map(disparity(reader, &args.map, args.scale)?);
    let left = args.left.as_deref().map(|path| input::left(reader, path)).transpose()?;
    let confidence = args.confidence.as_deref().map(|path| reader.grey8(path)).transpose()?;
    let of_left = args.left.as_deref().zip(left.as_ref().map(|image| image.pixels.size()));
    let of_confidence = args.confidence.as_deref().zip(confidence.as_ref().map(Plane::size));
    for (path, size) in of_left.into_iter().chain(of_confidence) {
        input::check_view(path, size, &args.map, map.size())?;
    }
    let (path, calibration) = calibration(args, map.size())?;
    let known = (path.as_deref().unwrap_or(input::NUMBERS.as_ref()), &calibration);
    let takes_unit = also.iter().find(|word| word.takes_unit()).or(also.first());
    let rig = takes_unit
        .map(|word| input::rig(&word.need(), Some(known), &args.map, map.size(), "give one with --calib"));
    let rig = rig.transpose()?;
    let behind = rig.as_ref().map(|rig| behind(args, &map, rig)).transpose()?.flatten();
    if !args.quiet {
        input::doubt_of(known, map.size());
    }
    let (width, height) = map.size();
    let confidence = confidence.unwrap_or_else(|| Plane::filled(width, height, u8::MAX));
    let maps = Maps::from_pixels(&map, confidence, Plane::filled(width, height, 0));
    let range = range(&map);
    for word in &also {
        word.check(&word.beside(output), range)?;
    }
    let outcome = Outcome {
        maps: &maps,
        range,
        sign: Sign::default(),
        left: left.as_ref(),
        rig,
        rectifying: None,
        third,
        sigma: None,
        georeferences: [None, None],
    };
    let mut written = Written::default();
    let mut said = Vec::new();
    for word in also {
        let path = word.beside(output);
        said.extend(written.note(&path, args.also.write(word, &path, &outcome))?);
    }
    written.keep();
    if let Some(behind) = behind.filter(|_| !args.quiet) {
        console::say(&format!("warning: {}: {behind}", args.map.display()));
    }
    if let Some(why) = args.also.left_out(&outcome).filter(|_| !args.quiet) {
        console::say(&format!("warning: {}: {why}", args.map.display()));
    }
    if !args.quiet && !said.is_empty() {
        said.dedup();
        let unit = input::unit(calibration.unit, path.as_deref());
        console::say(&format!("{}; unit: {unit}", said.join("; ")));
    }
    Ok(())
}

/// A warning if most of a map lies behind the cameras.
///
/// # Errors
/// If all of it does, or there is no disparity.
fn behind(args: &Args, map: &Plane<f32>, rig: &Rig) -> Result<Option<String>> {
    let in_front = InFront::of(map, rig);
    if in_front.all == 0 {
        return Err(Error::read(&args.map, "contains no disparity: all pixels are infinite or NaN").into());
    }
    let check = "check that the calibration is of this map, and that the map is not empty";
    match in_front.doubt(&other_sign(args.sign), check) {
        Some(told) if in_front.seen == 0 => Err(Error::read(&args.map, told).into()),
        told => Ok(told),
    }
}

/// The calibration of a map of this size, and its file if it has one.
fn calibration(args: &Args, size: (usize, usize)) -> Result<(Option<PathBuf>, Calibration)> {
    if let Some(calibration) = args.numbers.calibration(size) {
        return Ok((None, calibration));
    }
    if let Some(first) = args.calib.first() {
        return Ok((Some(first.clone()), input::of_rectified_images(&args.calib, &args.crop, size)?));
    }
    if let Some(files) = input::beside(&args.map) {
        return Ok((files.first().cloned(), input::of_rectified_images(&files, &args.crop, size)?));
    }
    let reason = format!("missing; there is no calib.txt beside {} either", args.map.display());
    Err(Failure::usage("--calib", reason))
}

/// The range of the disparities in a map.
fn range(map: &Plane<f32>) -> DisparityRange {
    let known = || map.data().iter().copied().filter(|d| d.is_finite());
    let (min, max) = (known().fold(f32::MAX, f32::min), known().fold(f32::MIN, f32::max));
    if min <= max {
        DisparityRange { min: min.floor() as i32, max: max.ceil() as i32 }
    } else {
        DisparityRange { min: 0, max: 0 }
    }
}
