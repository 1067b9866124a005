//! What matches the pairs of a node, and what it takes for that: the range and the cameras, which are found anew when the cameras change.

use std::path::{Path, PathBuf};

use mrfgs::Matcher;
use mrfgs::calibration::cameras::ThirdCamera;
use mrfgs::depth::Rig;
use mrfgs::image::Pair;
use mrfgs::image::read::Reader;
use mrfgs::options::{DisparityRange, Execution};
use mrfgs::rectification::Rectification;
use mrfgs::sigma::Sigma;
use mrfgs::steady::Steady;
use mrfgs::threads;
use mrfgs_ros::messages::{CameraInfo, Encoding, Header};

use crate::args::Sign;
use crate::failure::{Failure, Result};
use crate::outputs::messages::{self, Messages, Sink};
use crate::outputs::{Cameras as Maps, Outcome};
use crate::pairs::input::{Calib, Input};
use crate::sequences::{Rectifier, ros};
use crate::{console, remedy, stop};

use super::args::Args;
use super::arrivals::{Arrived, Cameras};
use super::log::Log;
use super::publications::Publications;

/// Matches pairs and publishes what it finds.
pub(super) struct Matching<'a> {
    args: &'a Args,
    cameras: Cameras,
    matcher: Matcher,
    sigma: Sigma,
    /// The camera of `--into`.
    third: Option<ThirdCamera>,
    /// `None` before the first pair.
    known: Option<Known>,
    /// Whether it was told that the match runs elsewhere than asked for.
    noted: bool,
}

/// What is known of the cameras and of what they see.
struct Known {
    /// What it follows from: the size of the images, and what the cameras say.
    size: (usize, usize),
    infos: Option<[CameraInfo; 2]>,
    range: DisparityRange,
    rectifier: Rectifier,
    rig: Option<Rig>,
    messages: Messages,
    steady: Option<Steady>,
}

impl<'a> Matching<'a> {
    pub(super) fn new(args: &'a Args, cameras: Cameras, execution: Execution) -> Result<Self> {
        let third = args.also.third()?;
        let method = args.also.made_by(args.method.method()?)?;
        let sigma = Sigma::for_method(&method);
        if args.are_rectified(&cameras) {
            args.rectification.options_if(false)?;
        }
        let matcher = Matcher::builder().method(method).execution(execution).build()?;
        Ok(Self { args, cameras, matcher, sigma, third, known: None, noted: false })
    }

    /// Matches a pair whose cameras say this, and publishes what it finds. What makes no sense is told by the log.
    ///
    /// # Errors
    /// Where nothing that follows can be matched either.
    pub(super) fn publish(
        &mut self,
        arrived: Arrived,
        infos: Option<[CameraInfo; 2]>,
        to: &mut Publications,
        log: &mut Log,
    ) -> Result<()> {
        let is_rectified = self.cameras.are_rectified();
        let are_known = |infos: &[CameraInfo; 2]| infos.iter().all(|info| ros::is_known(info, is_rectified));
        let infos = infos.filter(are_known);
        if infos.is_none() && !self.args.gives_cameras() {
            log.waits(&self.cameras);
            return Ok(());
        }
        match self.published(&arrived, infos, to) {
            Ok(doubts) => {
                log.published(&arrived);
                doubts.iter().flatten().for_each(|doubt| log.doubted(doubt));
            }
            Err(Failure::Stopped(_)) => {}
            Err(failure @ Failure::Usage(_)) => return Err(failure),
            Err(failure) => log.failed(&failure.to_string()),
        }
        Ok(())
    }

    fn published(
        &mut self,
        arrived: &Arrived,
        infos: Option<[CameraInfo; 2]>,
        to: &mut Publications,
    ) -> Result<[Option<String>; 2]> {
        let header = &arrived.header;
        let pair = self.pair(arrived)?;
        let is_known = |known: &Known| known.size == pair.size() && known.infos == infos;
        if !self.known.as_ref().is_some_and(is_known) {
            self.known = None;
            self.known = Some(self.begin(pair.clone(), infos)?);
        }
        let Some(known) = &mut self.known else { return Ok([None, None]) };
        let (pair, _) = known.rectifier.rectified(pair)?;
        let matched = self.matcher.job(&pair, known.range).cancel(stop::flag()).run()?;
        if let Some(note) = matched.note.as_ref().filter(|_| !std::mem::replace(&mut self.noted, true)) {
            console::say(&remedy::error(note, &remedy::FLAGS));
        }
        let mut maps = matched.maps;
        if let Some(steady) = &mut known.steady {
            steady.follow(pair.left(), &mut maps);
        }
        let outcome = Outcome {
            maps: &maps,
            range: known.range,
            sign: Sign::default(),
            left: Some(pair.left()),
            rig: known.rig,
            rectifying: None,
            third: self.third,
            sigma: Some(self.sigma),
            georeferences: [None, None],
        };
        let map = outcome.final_map(self.args.also.limits);
        let messages = &known.messages;
        to.put(messages::DISPARITY, header, &messages.disparity(header, &map, outcome.typical_sigma()))?;
        if to.have_depth_camera()
            && let Some(camera) = messages.camera(header, map.size())
        {
            to.put(messages::DEPTH_CAMERA, header, &camera)?;
        }
        messages.put(header, self.args.also.contents(&outcome), to)?;
        Ok(pair.doubts().clone())
    }

    /// The images of a pair.
    fn pair(&self, Arrived { header, images: [left, right], .. }: &Arrived) -> Result<Pair> {
        let view = |side: usize, bytes: &[u8]| {
            let stamp = Header::of(bytes, Encoding::Cdr).map_or(header.stamp, |header| header.stamp);
            let name = self.cameras.named(side, stamp);
            ros::view(self.cameras.kind(side), bytes, Encoding::Cdr, Reader::default(), &name)
        };
        let (left, right) = threads::join(|| view(0, left), || view(1, right));
        let rectified = self.args.are_rectified(&self.cameras);
        Ok(if rectified { Pair::of_frames(left?, right?)? } else { Pair::of_raw_frames(left?, right?)? })
    }

    /// What follows from the first pair of cameras that say this.
    fn begin(&mut self, pair: Pair, infos: Option<[CameraInfo; 2]>) -> Result<Known> {
        let args = self.args;
        let size = pair.size();
        let texts = self.texts(infos.as_ref())?;
        let calib = texts.as_deref().map_or(Calib::Files(&args.calib, &args.crop), Calib::Texts);
        let rectifying = args.rectification.options_if(!args.are_rectified(&self.cameras))?;
        let (sign, numbers) = (Sign::default(), Some(&args.numbers));
        let mut input = Input::new(pair, &args.search, sign, calib, numbers, rectifying.as_ref(), None)?;
        if let Some(by) = &mut input.rectification {
            by.keep_places()?;
        }
        if !args.quiet {
            input.say_range(sign, " in this frame");
            input.warn(None);
        }
        let word = args.also.take_cameras();
        let rig = match word {
            Some(_) => input.rig(word, Path::new(self.cameras.image(0)))?,
            None => None,
        };
        if let (Some(word), Some(rig)) = (word, &rig) {
            word.check_metres(rig)?;
        }
        let range = self.range(&input)?;
        let cameras = input.calibration().and_then(|calibration| Maps::of(calibration, (0, 0)));
        let known = input.calibration().and_then(|known| Rectification::of_rectified(known, size).ok());
        let rectifier = Rectifier::new(input.rectification, known, range, args.recalibrate);
        let (messages, steady) = (
            Messages::new(range, cameras, args.also.framed(self.third.as_ref())),
            args.steady.then(Steady::new),
        );
        Ok(Known { size, infos, range, rectifier, rig, messages, steady })
    }

    /// What the cameras say in the words of files, unless the user says it.
    fn texts(&self, infos: Option<&[CameraInfo; 2]>) -> Result<Option<Vec<(PathBuf, String)>>> {
        let Self { args, cameras, .. } = self;
        let Some([l, r]) = infos.filter(|_| !args.gives_cameras()) else { return Ok(None) };
        if ros::are_exchanged([l, r]) {
            let (left, right) = (cameras.image(0), cameras.image(1));
            let reason = format!(
                "by its calibration {left} is the right camera; remap left/image_raw to {right}, and the other way round"
            );
            return Err(Failure::Failed(reason));
        }
        let text =
            |name: &str, camera: &CameraInfo| (name.into(), ros::text(camera, cameras.are_rectified()));
        Ok(Some(vec![text(cameras.info(0), l), text(cameras.info(1), r)]))
    }

    /// The range of all frames: where sparse matches found it, a match of this frame shows whether that is enough.
    fn range(&mut self, input: &Input) -> Result<DisparityRange> {
        let searched = input.searched(|_| true);
        if !searched.may_widen {
            return Ok(input.range);
        }
        let matched = searched.job(&mut self.matcher, &input.pair).cancel(stop::flag()).run()?;
        if !self.args.quiet {
            input.say_wider(&matched, Sign::default(), " of this frame");
        }
        Ok(matched.range())
    }
}

impl Args {
    /// Whether the user says the cameras.
    fn gives_cameras(&self) -> bool {
        !self.calib.is_empty() || self.numbers.flag().is_some()
    }

    /// Whether images come rectified: by the names of their topics, or since the user gives the numbers of rectified ones.
    fn are_rectified(&self, cameras: &Cameras) -> bool {
        cameras.are_rectified() || self.numbers.flag().is_some()
    }
}
