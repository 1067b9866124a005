//! The arguments of `mrfgs match`.

use std::path::{Path, PathBuf};

use crate::args::{
    BlockArgs, CameraArgs, ExecutionArgs, MethodArgs, PriorArgs, RectificationArgs, RegionArgs, Sign,
};
use crate::outputs::AlsoArgs;
use crate::pairs::input::PairArgs;

const EXAMPLES: &str = "\
Examples:
  # Two hand-held photos, and the result in the browser:
  mrfgs match l.jpg r.jpg d.pfm --rectify --show
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
#[allow(clippy::struct_excessive_bools, reason = "each is a flag")]
pub(crate) struct Args {
    #[command(flatten)]
    pub(super) pair: PairArgs,
    #[command(flatten)]
    pub(super) region: RegionArgs,
    #[command(flatten)]
    pub(super) blocks: BlockArgs,
    #[command(flatten)]
    pub(super) numbers: CameraArgs,
    /// Disparity map to write: .pfm, .tif, .tiff or .png, or `-`
    pub(super) output: Option<PathBuf>,

    /// Sign convention of disparities, for the range, OUTPUT and --also raw; the Ames Stereo Pipeline uses right-minus-left
    #[arg(long, value_enum, default_value_t, value_name = "WHICH")]
    pub(super) sign: Sign,
    /// Rectifies raw images first, as `mrfgs rectify` does: with --calib, or without a calibration from matches between the images (then
    /// there is no depth, and a calib.txt beside LEFT is ignored). All outputs belong to the rectified left view
    #[arg(long)]
    pub(super) rectify: bool,
    #[command(flatten)]
    pub(super) rectification: RectificationArgs,
    #[command(flatten)]
    pub(super) prior: PriorArgs,
    /// Checks everything and prints the plan (levels, schedule, memory), but runs and writes nothing
    #[arg(long)]
    pub(super) dry_run: bool,
    /// Prints errors only
    #[arg(long)]
    pub(super) quiet: bool,

    #[command(flatten)]
    pub(super) method: MethodArgs,
    #[command(flatten)]
    pub(super) execution: ExecutionArgs,

    #[command(flatten)]
    pub(super) also: AlsoArgs,
    /// Opens the page of --also view in the browser at the end: the map and the surface in 3-D. Without --also view, the page goes to the
    /// folder for temporary files
    #[arg(long, help_heading = "More outputs")]
    pub(super) show: bool,
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
    pub(super) json: Option<PathBuf>,
}

impl Args {
    pub(super) fn output(&self) -> &Path {
        self.output.as_deref().expect("`run` has refused a command line without it")
    }

    /// Whether an output shows the left image.
    pub(super) fn show_left(&self) -> bool {
        self.show || self.also.show_left()
    }
}
