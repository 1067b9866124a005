//! The command line of `mrfgs match`, checked, and the pair that it names.

use std::path::{Path, PathBuf};

use mrfgs::calibration::cameras::ThirdCamera;
use mrfgs::options::{DisparityRange, Execution, Method};
use mrfgs::rectification::Options;
use mrfgs::region::Blocks;

use super::args::Args;
use crate::args::CameraNeed;
use crate::failure::{Failure, Result};
use crate::outputs::{Also, also, files};
use crate::pairs::input::Input;
use crate::pairs::large::PairFiles;
use crate::pairs::views::Views;

/// The command line, checked.
pub(super) struct Request<'a> {
    pub(super) args: &'a Args,
    pub(super) execution: Execution,
    pub(super) method: Method,
    /// How raw images are rectified, if they are.
    pub(super) rectifying: Option<Options>,
    /// An output that takes the cameras, if there is one.
    pub(super) cameras: Option<&'static Also>,
    /// The flag of the output or prior that uses the cameras, and whether it can do without them.
    pub(super) need: Option<CameraNeed>,
    /// The camera of `--into`.
    pub(super) third: Option<ThirdCamera>,
}

impl<'a> Request<'a> {
    pub(super) fn new(args: &'a Args) -> Result<Self> {
        // First, since it also limits the threads that read the images.
        let execution = args.execution.execution();
        let method = args.also.made_by(args.method.method()?)?;
        let cameras = args.also.take_cameras().or(args.show.then(also::view));
        let rectifying = args.rectification.options_if(args.rectify)?;
        args.also.check(args.rectify, args.show)?;
        let third = args.also.third()?;
        let need = CameraNeed::strictest([cameras.map(Also::need), args.prior.need()]);
        if args.rectify && args.pair.calib.is_empty() {
            let flag = need.as_ref().filter(|need| !need.optional).map(|need| need.flag.clone());
            let flag = flag.or(args.numbers.flag().map(str::to_owned));
            if let Some(flag) = flag {
                let reason = "without a calibration there is no scale and so no depth; add --calib FILE";
                return Err(Failure::usage(flag, reason));
            }
        }
        Ok(Self { args, execution, method, rectifying, cameras, need, third })
    }

    /// The whole pair.
    pub(super) fn input(&self) -> Result<Input> {
        let Self { args, need, rectifying, .. } = self;
        args.pair.read(args.sign, need.is_some(), Some(&args.numbers), rectifying.as_ref())
    }

    /// The pair as `views` that are read when needed.
    pub(super) fn input_of<V: Views>(&self, views: V) -> Result<Input<V>> {
        self.args.pair.of_views(views, self.args.sign, self.need.is_some(), Some(&self.args.numbers))
    }

    /// The files of a pair that can be read by windows; `None` for raw pairs, files with both views and pipes, which are read whole.
    pub(super) fn files(&self) -> Option<PairFiles<'_>> {
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
    pub(super) fn scratch(&self) -> PathBuf {
        let output = self.args.output();
        if files::is_printed(output) { std::env::temp_dir() } else { files::parent(output).to_owned() }
    }

    /// Whether the pair is matched in blocks that are read by windows: where the user says so, and where that pays for a pair of its size
    /// and the range of the flags, or the least one.
    pub(super) fn goes_by_blocks(&self) -> Result<bool> {
        if self.args.blocks.blocks.is_some() {
            return Ok(true);
        }
        // Errors of the files are reported when these are read.
        let Some(Ok(size)) = self.files().map(|files| files.reader.size(files.left)) else {
            return Ok(false);
        };
        let range = self.args.pair.search.given(self.args.sign).unwrap_or(DisparityRange { min: 0, max: 0 });
        Ok(self.args.region.roi.is_none() && Blocks::pay(size, range, &self.method)?)
    }
}
