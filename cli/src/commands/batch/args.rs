//! The arguments of `mrfgs batch`.

use std::path::PathBuf;

use serde::Serialize;

use crate::args::{CropArgs, ExecutionArgs, MethodArgs, ReadingArgs, RectificationArgs, Shard, shard};
use crate::outputs::MapArgs;

const EXAMPLES: &str = "\
Examples:
  mrfgs batch pairs.csv maps
  mrfgs batch pairs.csv maps              # run it again to resume
  mrfgs batch MiddEval3/trainingQ maps --format png --also validity
  mrfgs batch photos maps                 # from photos/left and photos/right
  mrfgs batch KITTI2015/training maps --format png
  mrfgs batch pairs.csv maps --rectify --calib rig.yml
  mrfgs batch pairs.csv maps --status
  mrfgs batch pairs.csv maps --shard 3/8  # the third of eight machines

A list:
  name,left,right,max_disparity
  # a comment
  street-01,left/01.png,right/01.png,127
  street-02,left/02.png,right/02.png,";

/// Match many pairs, and resume an interrupted run
///
/// LIST is a CSV file whose header names the columns: name, left, right, and optionally `max_disparity`, `min_disparity`, mask,
/// calibration, prior, `prior_sigma`, `prior_kind`, `prior_unit` and `prior_pose`, which correspond to flags of `mrfgs match`; separate
/// several calibration files with a semicolon. An empty field means no value; without a range, that of the calibration is searched, else one
/// estimated from the images. Relative paths start at the folder of LIST; lines starting with # are comments.
///
/// LIST may also be a folder. If it holds the images of the cameras in the folders left and right, or in KITTI's `image_2` and `image_3`,
/// `colored_0` and `colored_1`, or `image_0` and `image_1`, those with the same number are a pair, named after the left one. Colour pairs of
/// KITTI take their calibrations from `calib_cam_to_cam` or calib, others the calib.txt in LIST. Else each .mpo or .jps file in LIST is a
/// pair. Else each visible folder in LIST is a pair, in one of the layouts of `mrfgs evaluate`; without a calib.txt the range is that of
/// the ground truth.
///
/// Names become file names: at most 200 bytes, letters of any script and spaces, but none of / \ : * ? " < > | and control characters, no
/// leading . or -, no trailing . or space. Names must differ by more than case.
///
/// For each pair the map goes to OUTDIR/NAME.pfm (see --format) and then its record to OUTDIR/NAME.json: the fields of `match --json`,
/// `status` ("done" or "failed", with a `reason`), `warnings`, the `request` (inputs with sizes in bytes and times in ms since 1970, range,
/// outputs, and the flags that affect them), and the `bytes` of each output. A pair is complete if its record says done with the same
/// request, method and version, and its outputs exist with the recorded sizes. A later run skips complete pairs and matches the others. A
/// failing pair is reported and does not stop the others.
// The record contains every field without `skip`. Skipped ones change no output, or are recorded elsewhere.
#[derive(clap::Args, Serialize)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// CSV file with a row per pair, folder with the folders left and right, or folder with a folder per pair
    #[serde(skip)]
    pub(super) list: PathBuf,
    /// Folder for maps and records; created if it does not exist
    #[arg(value_name = "OUTDIR")]
    #[serde(skip)]
    pub(super) folder: PathBuf,

    /// Calibration of all pairs without one in LIST, as for `mrfgs match` [default: a calib.txt beside the left image]
    #[arg(long, value_name = "FILE")]
    // Not recorded here: it is among the inputs.
    #[serde(skip)]
    pub(super) calib: Vec<PathBuf>,
    #[command(flatten)]
    #[serde(flatten)]
    pub(super) crop: CropArgs,
    /// Rectifies raw pairs first, each by its calibration or without one from its own matches, as `mrfgs rectify` does
    #[arg(long)]
    pub(super) rectify: bool,
    #[command(flatten)]
    #[serde(flatten)]
    pub(super) rectification: RectificationArgs,
    #[command(flatten)]
    #[serde(flatten)]
    pub(super) maps: MapArgs,
    /// Matches only part K of N of the list (K from 1), such as 2/8
    ///
    /// The part of a pair depends only on its name and N (64-bit FNV-1a, both halves combined by exclusive or, modulo N), so it stays the
    /// same when pairs are added or removed. Several runs may write to the same OUTDIR at the same time: each pair is matched once, since a
    /// run locks its pair (OUTDIR/.NAME.tmp) if the file system supports locks.
    #[arg(long, value_name = "K/N", value_parser = shard)]
    #[serde(skip)]
    pub(super) shard: Option<Shard>,
    /// Prints the state of each pair (complete, failed or missing) for the same arguments, and runs nothing
    #[arg(long)]
    #[serde(skip)]
    pub(super) status: bool,
    #[command(flatten)]
    #[serde(flatten)]
    pub(super) reading: ReadingArgs,
    /// Prints errors only
    #[arg(long)]
    #[serde(skip)]
    pub(super) quiet: bool,

    // Recorded as the resulting method instead.
    #[command(flatten)]
    #[serde(skip)]
    pub(super) method: MethodArgs,
    #[command(flatten)]
    #[serde(skip)]
    pub(super) execution: ExecutionArgs,
}
