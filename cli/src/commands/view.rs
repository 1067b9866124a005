//! `mrfgs view`.

use std::path::{Path, PathBuf};

use mrfgs::Error;
use mrfgs::colour::ColourMap;
use mrfgs::depth::Rig;
use mrfgs::image::Plane;
use mrfgs::image::read::Reader;

use crate::args::{CameraArgs, CropArgs, ReadingArgs, Sign, disparity, scale};
use crate::failure::{Failure, Result};
use crate::outputs::{Page, also, files, page};
use crate::pairs::input;

const EXAMPLES: &str = "\
Examples:
  mrfgs view d.pfm --left im0.png
  mrfgs view scene/disp0GT.pfm --left scene/im0.png --calib scene/calib.txt
  mrfgs view d.pfm --left im0.png --output d.html";

/// Show a disparity map and its surface in the browser
///
/// MAP is a disparity map in pixels, from this or another program: .pfm, .tif, or 16-bit .png as in KITTI. The page shows it in colours
/// with its values under the pointer, and the surface in 3-D; without cameras that surface is not to scale. It is one file that
/// needs no network, in the folder for temporary files or at --output. Confidence and validity are read from the files of --also confidence
/// and --also validity beside MAP, such as d.confidence.png, if they are there.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Disparity map of the left view
    map: PathBuf,
    /// Left image, shown beside the map and on the surface
    #[arg(long, value_name = "FILE")]
    left: Option<PathBuf>,
    /// Calibration of the rectified pair, as for `mrfgs match` [default: a calib.txt beside MAP]
    #[arg(long, value_name = "FILE")]
    calib: Vec<PathBuf>,
    #[command(flatten)]
    crop: CropArgs,
    #[command(flatten)]
    numbers: CameraArgs,
    /// Writes the page to this .html file, and opens no browser
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Sign convention of the disparities in MAP
    #[arg(long, value_enum, default_value_t, value_name = "WHICH")]
    sign: Sign,
    /// Grey levels per pixel of disparity, for integers in MAP; level 0 is unknown [default: 256 for 16-bit PNG]
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = scale)]
    scale: Option<f32>,
    #[command(flatten)]
    reading: ReadingArgs,
}

pub(crate) fn run(args: &Args) -> Result<()> {
    let reader = args.reading.reader();
    let [confidence, validity] = ["confidence", "validity"].map(|word| beside(word, &args.map));
    if let Some(output) = &args.output {
        check_output(output)?;
        let inputs = std::iter::once(&args.map).chain(&args.left).chain(&args.calib);
        let inputs = inputs.chain(&confidence).chain(&validity).map(|path| ("an input", path.as_path()));
        files::distinct(&inputs.collect::<Vec<_>>(), &[("--output", output)])?;
    }
    let map = args.sign.map(disparity(reader, &args.map, args.scale)?);
    if !map.data().iter().any(|d| d.is_finite()) {
        return Err(Error::read(&args.map, "contains no disparity: all pixels are infinite or NaN").into());
    }
    let left = args.left.as_deref().map(|path| input::left(reader, path)).transpose()?;
    if let Some((path, left)) = args.left.as_deref().zip(left.as_ref()) {
        input::check_view(path, left.pixels.size(), &args.map, map.size())?;
    }
    let levels =
        |path: &Option<PathBuf>| path.as_deref().map(|path| levels(reader, path, args, &map)).transpose();
    let (confidence, validity) = (levels(&confidence)?, levels(&validity)?);
    let page = Page {
        map: &map,
        confidence: confidence.as_ref(),
        validity: validity.as_ref(),
        left: left.as_ref(),
        rig: rig(args, map.size())?,
        clip_depth: None,
        colours: ColourMap::default(),
    };
    let name = page::name(&args.map);
    if let Some(output) = &args.output {
        return page.save(output, &name);
    }
    page::show(&page::aside(&name, |path| page.save(path, &name))?, false);
    Ok(())
}

/// Refuses a name that browsers would not take for a page.
fn check_output(output: &Path) -> Result<()> {
    if !output.extension().is_some_and(|own| own.eq_ignore_ascii_case("html")) {
        let reason = format!("{} is no name of a page; give one that ends in .html", output.display());
        return Err(Failure::usage("--output", reason));
    }
    Ok(mrfgs::image::write::check_path(output)?)
}

/// The file of `--also WORD` beside a map, if it is there.
fn beside(word: &str, map: &Path) -> Option<PathBuf> {
    also::of_word(word).map(|also| also.beside(map)).filter(|path| path.exists())
}

/// The levels in the file `path` beside the map.
fn levels(reader: Reader, path: &Path, args: &Args, map: &Plane<f32>) -> Result<Plane<u8>> {
    let levels = reader.grey8(path)?;
    input::check_view(path, levels.size(), &args.map, map.size())?;
    Ok(levels)
}

/// The cameras of a map of this size: those of the flags, which must have all values, else those of a calib.txt beside it that has them.
fn rig(args: &Args, size: (usize, usize)) -> Result<Option<Rig>> {
    if let Some(calibration) = args.numbers.calibration(size) {
        return Ok(input::known_rig(&calibration, size));
    }
    if let Some(first) = args.calib.first() {
        let calibration = input::of_rectified_images(&args.calib, &args.crop, size)?;
        let need = also::view().need();
        return Ok(Some(input::rig(&need, Some((first, &calibration)), &args.map, size, "")?));
    }
    match input::beside(&args.map) {
        Some(files) => Ok(input::known_rig(&input::of_rectified_images(&files, &args.crop, size)?, size)),
        None => Ok(None),
    }
}
