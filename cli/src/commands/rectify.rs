//! `mrfgs rectify`.

use std::path::{Path, PathBuf};

use mrfgs::calibration::write as calibration_text;
use mrfgs::check;
use mrfgs::image::{Image, pfm, write};
use mrfgs::rectification::Rectification;

use crate::args::{CropArgs, ReadingArgs, RectificationArgs};
use crate::failure::{Failure, Result};
use crate::outputs::StagedFolder;
use crate::pairs::input;
use crate::{console, stop};

const EXAMPLES: &str = "\
Examples:
  mrfgs rectify left.png right.png rectified --calib stereo.yml
  mrfgs match rectified/im0.png rectified/im1.png d.pfm --also depth
  # Two hand-held photos, without a calibration:
  mrfgs rectify left.jpg right.jpg rectified
  # ROS has a file per camera:
  mrfgs rectify l.png r.png rectified --calib left.yaml --calib right.yaml
  # Keep everything that the cameras saw:
  mrfgs rectify l.png r.png rectified --calib camchain.yaml --alpha 1";

/// Rectify a pair of raw images
///
/// Rectified images have no lens distortion, and matching points are in the same row. DIR gets im0.png and im1.png (transparent where a
/// pixel has no source), mask0.png and mask1.png (white there), and with --calib the calibration of the rectified pair as calib.txt
/// (Middlebury) and cameras.yml (OpenCV).
///
/// Without --calib the pair is rectified by points that match in both images, as for two hand-held photos of one camera. A line tells how
/// reliable that is. There is no scale then, and no depth. Images are rotated upright by their EXIF orientation, but not with --calib, as a
/// calibration applies to pixels as stored.
///
/// CALIB is OpenCV's YAML, XML or JSON (K1, D1, K2, D2, R, T, or R1, R2, P1, P2 too), ROS's `camera_info` of both cameras, Kalibr's camera
/// chain (cam0 is the left camera), a file of EuRoC, KITTI, ORB-SLAM3, VINS-Fusion, Basalt, ZED, OAK, COLMAP, mrcal or OKVIS, or
/// Middlebury's calib.txt, recognised by content. Lenses are pinholes with radial and tangential distortion, fisheyes (equidistant;
/// `fisheye: 1` in OpenCV's files), omni, double sphere, extended unified or field of view; see the guide for a table.
///
/// The method is that of OpenCV's `stereoRectify`. Points at infinity have disparity 0. If one camera is above the other, both images are
/// rotated by 90 degrees so that epipolar lines become rows: counter-clockwise if the first camera is the upper one, clockwise otherwise.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Image of the left camera (the first in the calibration), or one file with both views (MPO, JPS), without RIGHT
    left: PathBuf,
    /// Image of the right camera
    right: Option<PathBuf>,
    /// Folder for the rectified pair, new or empty
    #[arg(value_name = "DIR")]
    folder: Option<PathBuf>,

    /// Calibration of the cameras; repeat the flag for several files, as with ROS [default: none, uses matches of the pair]
    #[arg(long, value_name = "CALIB")]
    calib: Vec<PathBuf>,
    #[command(flatten)]
    crop: CropArgs,
    #[command(flatten)]
    rectification: RectificationArgs,
    /// Also writes the source position of each rectified pixel: map0x.pfm, map0y.pfm, map1x.pfm and map1y.pfm
    #[arg(long)]
    maps: bool,
    /// Mask of the size of LEFT: pixels that are not black are ignored
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
    #[command(flatten)]
    reading: ReadingArgs,
    /// Prints errors only
    #[arg(long)]
    quiet: bool,
}

pub(crate) fn run(mut args: Args) -> Result<()> {
    input::behind_views(&args.left, &mut args.right, &mut args.folder)?;
    let missing = || Failure::usage("DIR", "missing; give a folder for the rectified pair");
    let folder = args.folder.take().ok_or_else(missing)?;
    stop::listen();
    let folder = StagedFolder::new_or_empty(&folder)?;
    let reader = args.reading.raw_reader(&args.calib)?;
    let options = args.rectification.options();
    let (left, right, mask) = (args.left.as_path(), args.right.as_deref(), args.mask.as_deref());
    let (rectification, pair) = if args.calib.is_empty() {
        let pair = input::views(reader, left, right, mask)?;
        input::rectify_alone([left, right.unwrap_or(left)], &pair, &options)?
    } else {
        let calibration = input::Calib::Files(&args.calib, &args.crop).read()?;
        let pair = input::raw_views(reader, left, right, mask)?;
        input::rectify(&calibration, &args.calib, &pair, &options)?
    };
    write_all(&folder.path(), &rectification, [pair.left(), pair.right()], args.maps)
        .map_err(|e| folder.named(e))?;
    folder.publish()?;
    if !args.quiet {
        input::warn(check::damaged(&pair));
        input::doubt(&rectification, &args.calib);
        let (width, height) = rectification.size();
        let known = |image: &Image| {
            let known = image.masked.data().iter().filter(|masked| !**masked).count();
            100.0 * known as f64 / (width * height) as f64
        };
        console::say(&format!(
            "{width} x {height}, {:.1} % of the left and {:.1} % of the right view have a source",
            known(pair.left()),
            known(pair.right())
        ));
    }
    Ok(())
}

fn write_all(folder: &Path, by: &Rectification, images: [&Image; 2], maps: bool) -> mrfgs::Result<()> {
    let at = |name: &str| folder.join(name);
    for (i, image) in images.into_iter().enumerate() {
        write::picture(&at(&format!("im{i}.png")), image)?;
        let mask = image.masked.map(|&masked| if masked { 255_u8 } else { 0 });
        write::picture(&at(&format!("mask{i}.png")), &mask)?;
    }
    if maps {
        for (i, map) in by.maps()?.iter().enumerate() {
            for (axis, map) in ["x", "y"].into_iter().zip(map) {
                write::save(&at(&format!("map{i}{axis}.pfm")), &pfm::encode(map))?;
            }
        }
    }
    if by.trust().is_some() {
        return Ok(());
    }
    let calibration = by.calibration()?;
    let texts = [
        ("calib.txt", calibration_text::middlebury(&calibration)),
        ("cameras.yml", calibration_text::opencv(&calibration, by.rotations())),
    ];
    texts.into_iter().try_for_each(|(name, text)| write::save(&at(name), text.unwrap_or_default().as_bytes()))
}
