//! Matches the pairs of a node. Range and calibration are determined again when the cameras change.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use mrfgs::calibration::cameras::ThirdCamera;
use mrfgs::depth::Rig;
use mrfgs::image::Pair;
use mrfgs::image::read::Reader;
use mrfgs::options::{DisparityRange, Execution};
use mrfgs::rectification::Rectification;
use mrfgs::sigma::Sigma;
use mrfgs::steady::Steady;
use mrfgs::threads;
use mrfgs::{Conditioning, Matcher, Prior};
use mrfgs_ros::messages::{CameraInfo, Encoding, Header};

use crate::args::{POSE, PriorTopicArgs, PriorView, Sign};
use crate::failure::{Failure, Result};
use crate::outputs::messages::{self, Messages, Sink};
use crate::outputs::{Also, Cameras, Outcome};
use crate::pairs::input::{Calib, Input};
use crate::sequences::known::{self, CloudDoubt, FramePriors};
use crate::sequences::{Rectifier, ros};
use crate::{console, remedy, stop};

use super::args::Args;
use super::arrivals::{Arrived, CameraTopics};
use super::log::Log;
use super::publications::{DEPTH_CAMERA, Publications};

/// Matches pairs and publishes the results.
pub(super) struct Matching<'a> {
    args: &'a Args,
    cameras: CameraTopics,
    matcher: Matcher,
    sigma: Sigma,
    /// Frames from one measurement of what is corrected in them to the next.
    measure_every: u32,
    /// The camera of `--into`.
    third: Option<ThirdCamera>,
    /// `None` before the first pair.
    known: Option<RigState>,
    /// Whether a change of device has been reported.
    noted: bool,
    /// Whether a pair without a cloud at its time has been reported.
    cloudless: bool,
}

/// Everything derived from the cameras and the first pair.
struct RigState {
    /// The image size and the calibration messages that this was derived from.
    size: (usize, usize),
    infos: Option<[CameraInfo; 2]>,
    range: DisparityRange,
    rectifier: Rectifier,
    rig: Option<Rig>,
    messages: Messages,
    steady: Option<Steady>,
    priors: FramePriors,
    /// The map of the last frame as the prior of the next, with `--prior last`.
    last: Option<Arc<Prior>>,
    /// The corrections of the last measured frame, and the frames that they have been used for.
    corrections: Option<(Conditioning, u32)>,
}

impl<'a> Matching<'a> {
    pub(super) fn new(args: &'a Args, cameras: CameraTopics, execution: Execution) -> Result<Self> {
        let third = args.also.third()?;
        let method = args.also.made_by(args.method.method()?)?;
        let sigma = Sigma::for_method(&method);
        // A correction of the calibration also changes the faults that are left in the frames.
        let measure_every = if args.recalibrate { 1 } else { method.front.measure_every };
        if args.are_rectified(&cameras) {
            args.rectification.options_if(false)?;
        }
        if args.prior.file().is_some_and(Path::is_dir) {
            let reason = "is a folder, but live frames have no names; give a file for all frames, or a lidar's topic with --prior-topic";
            return Err(Failure::usage("--prior", reason));
        }
        if known::is_moved_last(&args.prior) {
            let reason =
                "with --prior last names the poses of all frames, which live ones do not have; remove it";
            return Err(Failure::usage(POSE, reason));
        }
        let matcher = Matcher::builder().method(method).execution(execution).build()?;
        Ok(Self {
            args,
            cameras,
            matcher,
            sigma,
            measure_every,
            third,
            known: None,
            noted: false,
            cloudless: false,
        })
    }

    /// Matches a pair and publishes the results; `infos` are the cameras' calibrations. Errors of single pairs go to the log.
    ///
    /// # Errors
    /// Only errors that would also affect all later pairs.
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
                for doubt in &doubts {
                    log.doubted(doubt);
                }
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
    ) -> Result<Vec<String>> {
        let header = &arrived.header;
        let pair = self.pair(arrived)?;
        let is_known = |known: &RigState| known.size == pair.size() && known.infos == infos;
        if !self.known.as_ref().is_some_and(is_known) {
            self.known = None;
            self.known = Some(self.begin(pair.clone(), infos)?);
        }
        let Some(known) = &mut self.known else { return Ok(Vec::new()) };
        let mut doubts: Vec<String> = pair.doubts().iter().flatten().cloned().collect();
        let (pair, _) = known.rectifier.rectified(pair)?;
        let cloud = arrived.cloud.as_ref().map(|cloud| (cloud.as_slice(), Encoding::Cdr));
        let of_cloud = known.priors.of_cloud(cloud, header.stamp).unwrap_or_else(|doubt| {
            match doubt {
                // Once, as it may hold for all frames.
                CloudDoubt::Missing(_) if std::mem::replace(&mut self.cloudless, true) => {}
                CloudDoubt::Missing(doubt) | CloudDoubt::Unusable(doubt) => doubts.push(doubt),
            }
            None
        });
        let prior = of_cloud
            .or_else(|| known.last.take())
            .map_or_else(|| known.priors.of(""), |prior| Ok(Some(prior)))?;
        let corrections = known.corrections.filter(|(_, used)| *used < self.measure_every);
        let mut job = self.matcher.job(&pair, known.range).cancel(stop::flag());
        if let Some((measured, _)) = corrections {
            job = job.conditioning(measured);
        }
        if let Some(prior) = prior {
            job = job.prior(prior);
        }
        let matched = job.run()?;
        if known.priors.follow().is_some() {
            known.last = Some(Arc::new(Prior::of_maps(&matched.maps)));
        } else if let Some(doubt) = known::contradicted(&matched) {
            doubts.push(doubt);
        }
        known.corrections = Some((matched.conditioning, corrections.map_or(0, |(_, used)| used) + 1));
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
            to.put(DEPTH_CAMERA, header, &camera)?;
        }
        messages.put(header, self.args.also.contents(&outcome), to)?;
        Ok(doubts)
    }

    /// Decodes the images of a pair.
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

    /// Determines range and calibration from the first pair of these cameras.
    fn begin(&mut self, pair: Pair, infos: Option<[CameraInfo; 2]>) -> Result<RigState> {
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
        let clouds = PriorTopicArgs { prior_topic: self.cameras.clouds().map(str::to_owned) };
        let prior_need = known::need(&args.prior, &clouds)?;
        let taken = match word.map(Also::need).or(prior_need) {
            Some(need) => input.rig(Some(&need), Path::new(self.cameras.image(0)))?,
            None => None,
        };
        let rig = taken.filter(|_| word.is_some());
        if let (Some(word), Some(rig)) = (word, &rig) {
            word.check_metres(rig)?;
        }
        let view = PriorView { size, sign, rig: input.as_taken(taken) };
        let priors = FramePriors::new(&args.prior, &clouds, view, None)?;
        let range = self.range(&input)?;
        let cameras = input.calibration().and_then(|calibration| Cameras::of(calibration, (0, 0)));
        let known = input.calibration().and_then(|known| Rectification::of_rectified(known, size).ok());
        let rectifier = Rectifier::new(input.rectification, known, range, args.recalibrate);
        let (messages, steady) = (
            Messages::new(range, cameras, args.also.framed(self.third.as_ref())),
            args.steady.then(Steady::new),
        );
        Ok(RigState {
            size,
            infos,
            range,
            rectifier,
            rig,
            messages,
            steady,
            priors,
            last: None,
            corrections: None,
        })
    }

    /// The cameras' own calibrations as texts of files; `None` if the user gives the cameras.
    fn texts(&self, infos: Option<&[CameraInfo; 2]>) -> Result<Option<Vec<(PathBuf, String)>>> {
        let Self { args, cameras, .. } = self;
        let Some([l, r]) = infos.filter(|_| !args.gives_cameras()) else { return Ok(None) };
        if ros::are_exchanged([l, r]) {
            let (left, right) = (cameras.image(0), cameras.image(1));
            let reason = format!(
                "according to its calibration {left} is the right camera; remap left/image_raw to {right} and right/image_raw to {left}"
            );
            return Err(Failure::Failed(reason));
        }
        let text =
            |name: &str, camera: &CameraInfo| (name.into(), ros::text(camera, cameras.are_rectified()));
        Ok(Some(vec![text(cameras.info(0), l), text(cameras.info(1), r)]))
    }

    /// The range for all frames. If it was estimated, a match of this frame shows whether it must be wider.
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
    /// Whether the user gives the cameras.
    fn gives_cameras(&self) -> bool {
        !self.calib.is_empty() || self.numbers.flag().is_some()
    }

    /// Whether images are rectified, according to their topic names or because --focal describes a rectified pair.
    fn are_rectified(&self, cameras: &CameraTopics) -> bool {
        cameras.are_rectified() || self.numbers.flag().is_some()
    }
}
