//! The arguments of `mrfgs batch`.

use std::path::PathBuf;

use serde::Serialize;

use crate::args::{CropArgs, ExecutionArgs, MethodArgs, ReadingArgs, RectificationArgs};
use crate::outputs::MapArgs;

use super::shard::{Shard, shard};

const EXAMPLES: &str = "\
Examples:
  mrfgs batch pairs.csv maps
  mrfgs batch pairs.csv maps              # again: resumes what was stopped
  mrfgs batch MiddEval3/trainingQ maps --format png --also validity
  mrfgs batch pairs.csv maps --rectify --calib rig.yml
  mrfgs batch pairs.csv maps --status
  mrfgs batch pairs.csv maps --shard 3/8  # the third of eight machines

A list:
  name,left,right,max_disparity
  # a comment
  street-01,left/01.png,right/01.png,127
  street-02,left/02.png,right/02.png,";

/// Match many pairs, and resume where an earlier run was stopped
///
/// LIST is a CSV file whose header names its columns: name, left, right, and optionally `max_disparity`, `min_disparity`,
/// mask and calibration, which mean what the flags of `mrfgs match` mean; two files of a calibration have a ; between them.
/// An empty field counts as a flag that is not given; without a range, that of the calibration is searched, or else that of
/// sparse matches. Relative paths start at
/// the folder of LIST; lines that begin with # are comments. LIST may also be a folder: each folder in it that is not hidden
/// is a pair, in one of the layouts of `mrfgs evaluate`; without a calib.txt the range is that of the truth.
///
/// Names become names of files. They have up to 200 bytes, in letters of any script, with spaces, but without
/// / \ : * ? " < > | and control characters, no . or - first, no . or space last. Names must differ by more
/// than upper and lower case.
///
/// For each pair the map goes to OUTDIR/NAME.pfm (see --format), and then its record to OUTDIR/NAME.json: the fields of
/// `match --json`, `status` ("done" or "failed", with a `reason`), `warnings`, the `request` (inputs with sizes in bytes and
/// times in ms since 1970, range, outputs, and the flags that change them), and the `bytes` of each output. A pair is complete
/// when its record says done, has the same request, method and version, and its outputs are there with as many bytes. A further
/// run skips complete pairs and matches all others. A pair that fails is named, and the others go on.
// A record holds all that is not skipped here: what is skipped changes no byte of an output, or is in the record otherwise.
#[derive(clap::Args, Serialize)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// CSV file with a row for each pair, or folder with a folder for each
    #[serde(skip)]
    pub(super) list: PathBuf,
    /// Folder for maps and records; created where there is none
    #[arg(value_name = "OUTDIR")]
    #[serde(skip)]
    pub(super) folder: PathBuf,

    /// Calibration of all pairs for which LIST has none, as `mrfgs match` takes it [default: a calib.txt beside the left image]
    #[arg(long, value_name = "FILE")]
    // It is among the inputs.
    #[serde(skip)]
    pub(super) calib: Vec<PathBuf>,
    #[command(flatten)]
    #[serde(flatten)]
    pub(super) crop: CropArgs,
    /// The images are raw: rectifies each pair by its calibration first, as `mrfgs rectify` does
    #[arg(long)]
    pub(super) rectify: bool,
    #[command(flatten)]
    #[serde(flatten)]
    pub(super) rectification: RectificationArgs,
    #[command(flatten)]
    #[serde(flatten)]
    pub(super) maps: MapArgs,
    /// Matches the K-th of N parts of the list (K from 1 on), such as 2/8
    ///
    /// The part of a pair depends on its name and N alone (64-bit FNV-1a, upper and lower half joined by exclusive or,
    /// modulo N), so it stays the same when pairs are added or removed. Runs at the same time into the same OUTDIR, of parts or
    /// of the whole, match each pair once: a run locks the pair that it matches (OUTDIR/.NAME.tmp), where the file system has
    /// locks.
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

    // The record has the method that follows from it.
    #[command(flatten)]
    #[serde(skip)]
    pub(super) method: MethodArgs,
    #[command(flatten)]
    #[serde(skip)]
    pub(super) execution: ExecutionArgs,
}
