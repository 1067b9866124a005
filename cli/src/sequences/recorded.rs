//! Pairs from a ROS recording.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use mrfgs::image::raster::Raster;
use mrfgs::image::read::Reader;
use mrfgs::{Error, Result, threads};
use mrfgs_ros::messages::{CameraInfo, Header, Stamp};
use mrfgs_ros::pairing::{Companions, Pairing, Tally};
use mrfgs_ros::recording::{Message, Recording};
use mrfgs_ros::topics::{self, Topic};

use crate::args::{RecordingArgs, Topics};
use crate::sequences::known::SAME_TIME;
use crate::sequences::ros;
use crate::text::plural;

/// The pairs of a recording.
pub(crate) struct Recorded {
    images: Images,
    files: Vec<PathBuf>,
    /// The calibration of both cameras with the names of their topics, if present.
    cameras: Option<[(String, CameraInfo); 2]>,
    messages: Box<dyn Iterator<Item = Result<Message>> + Send>,
    pairing: Pairing<Message>,
    clouds: Option<Clouds>,
    /// The error that ended the messages.
    error: Option<Error>,
    ended: bool,
    /// The number of pairs so far.
    count: usize,
    first: [Option<Stamp>; 2],
    /// For each camera, the number of images with a time and with time 0.
    timed: [[usize; 2]; 2],
    remarks: Remarks,
}

/// The clouds of a lidar beside the images.
struct Clouds {
    /// The number of their topic among those that are read.
    topic: usize,
    waiting: Companions<Arc<Message>>,
}

/// How messages become images.
struct Images {
    path: PathBuf,
    topics: [Topic; 2],
    reader: Reader,
}

/// Remarks about a recording, collected while pairs are read.
#[derive(Clone, Default)]
pub(crate) struct Remarks(Arc<Mutex<Noted>>);

#[derive(Clone, Default)]
struct Noted {
    /// Images that gave no pair.
    tally: Tally,
    /// The topic and the time at which a calibration changed.
    changed: Option<(String, Stamp)>,
    /// The number of messages in the metadata, and the number found.
    missing: Option<(u64, u64)>,
}

/// Both views at one point in time, the header of the left one, and the cloud that belongs to it.
pub(super) struct RecordedViews {
    pub(super) header: Header,
    pub(super) views: [Raster<'static>; 2],
    pub(super) cloud: Option<Arc<Message>>,
}

impl Recorded {
    /// Whether `path` is a recording, by its name or its first bytes.
    pub(crate) fn is(path: &Path) -> bool {
        Recording::is(path)
    }

    /// Opens the recording `path`, with the topic `clouds` of a lidar, if there is one.
    ///
    /// # Errors
    /// If it cannot be read, does not have two image topics that form a pair, or no such topic of a lidar.
    pub(crate) fn open(
        path: &Path,
        args: &RecordingArgs,
        clouds: Option<&str>,
        reader: Reader,
    ) -> Result<Self> {
        let recording = Recording::open(path)?;
        let all = recording.topics();
        let chosen = match &args.topics {
            Some(Topics([left, right])) => {
                topics::named(all, left).and_then(|l| Ok([l, topics::named(all, right)?]))
            }
            None => topics::pair(all, "--topics"),
        };
        let chosen = chosen.map_err(|reason| Error::read(path, reason))?.map(Topic::clone);
        let cameras = cameras(&recording, &chosen)?;
        let infos = cameras.iter().flatten().map(|(topic, _)| topic.as_str());
        let mut names: Vec<_> = chosen.iter().map(|topic| topic.name.as_str()).chain(infos).collect();
        let clouds = clouds.map(|name| topics::clouds(all, name)).transpose();
        let clouds = clouds.map_err(|reason| Error::read(path, reason))?.map(|topic| {
            names.push(&topic.name);
            Clouds { topic: names.len() - 1, waiting: Companions::default() }
        });
        let remarks = Remarks::default();
        remarks.note(|noted| noted.missing = recording.missing());
        Ok(Self {
            files: recording.files().map(Path::to_owned).collect(),
            messages: Box::new(recording.messages(&names)),
            cameras,
            clouds,
            pairing: Pairing::new(args.tolerance.unwrap_or(0)),
            error: None,
            ended: false,
            count: 0,
            first: [None; 2],
            timed: [[0; 2]; 2],
            remarks,
            images: Images { path: path.to_owned(), topics: chosen, reader },
        })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.images.path
    }

    pub(super) fn files(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().map(PathBuf::as_path)
    }

    /// A handle to the remarks.
    pub(crate) fn remarks(&self) -> Remarks {
        self.remarks.clone()
    }

    /// Whether the images are rectified, according to the names of their topics.
    pub(crate) fn is_rectified(&self) -> bool {
        self.images.topics.iter().all(Topic::is_rectified)
    }

    /// Whether a topic name marks the images as raw.
    pub(crate) fn is_raw(&self) -> bool {
        self.images.topics.iter().any(Topic::is_raw)
    }

    /// The topic of the left images, and the topic where its calibration would be.
    pub(crate) fn left_topic(&self) -> (&str, String) {
        let beside = self.images.topics[0].camera_infos().pop().unwrap_or_default();
        (&self.images.topics[0].name, beside)
    }

    /// The recorded calibration of both cameras: a text for each, with its name.
    ///
    /// # Errors
    /// If left and right are swapped.
    pub(crate) fn calibration(&self) -> Result<Option<Vec<(PathBuf, String)>>> {
        let Some(cameras) = &self.cameras else { return Ok(None) };
        if ros::are_exchanged(cameras.each_ref().map(|(_, camera)| camera)) {
            let [left, right] = self.images.topics.each_ref().map(|topic| topic.name.as_str());
            let reason = format!(
                "according to its calibration {left} is the right camera; give --topics {right},{left}"
            );
            return Err(Error::read(&self.images.path, reason));
        }
        let texts = cameras.iter().map(|(topic, camera)| {
            let name = format!("{}:{topic}", self.images.path.display());
            (PathBuf::from(name), ros::text(camera, self.is_rectified()))
        });
        Ok(Some(texts.collect()))
    }

    /// The next pair; `None` after the last one.
    pub(super) fn next(&mut self) -> Option<Result<RecordedViews>> {
        loop {
            if let Some(error) = self.without_times() {
                return Some(Err(error));
            }
            let pair = self.pairing.next(self.ended);
            self.remarks.note(|noted| noted.tally = self.pairing.tally());
            if let Some([(stamp, left), (_, right)]) = pair {
                self.count += 1;
                let cloud = self.clouds.as_mut().and_then(|clouds| {
                    clouds.waiting.forget_before(Stamp(stamp.0.saturating_sub(SAME_TIME as i64)));
                    clouds.waiting.nearest(stamp, SAME_TIME).map(Arc::clone)
                });
                let images = &self.images;
                let (l, r) = threads::join(|| images.view(&left), || images.view(&right));
                let header = header(&left).map_err(|reason| images.at(&left, reason));
                return Some(header.and_then(|header| Ok(RecordedViews { header, views: [l?, r?], cloud })));
            }
            if self.ended {
                let error = self.error.take();
                return error.or_else(|| (self.count == 0).then(|| self.without_pairs())).map(Err);
            }
            match self.messages.next().map(|message| message.and_then(|message| self.add(message))) {
                Some(Ok(())) => {}
                Some(Err(error)) => (self.ended, self.error) = (true, Some(error)),
                None => self.ended = true,
            }
        }
    }

    fn add(&mut self, message: Message) -> Result<()> {
        let (side, bytes) = (message.topic, message.data.len());
        if let Some(clouds) = self.clouds.as_mut().filter(|clouds| clouds.topic == side) {
            // One without a time belongs to no image.
            if let Ok(Header { stamp, .. }) = header(&message) {
                clouds.waiting.add(stamp, Arc::new(message), bytes);
            }
            return Ok(());
        }
        if let Some(side) = side.checked_sub(self.images.topics.len()) {
            self.check_camera(side, &message);
            return Ok(());
        }
        let Header { stamp, .. } = header(&message).map_err(|reason| self.images.at(&message, reason))?;
        self.first[side].get_or_insert(stamp);
        self.timed[side][usize::from(stamp.0 == 0)] += 1;
        self.pairing.add(side, stamp, message, bytes);
        Ok(())
    }

    /// Refuses a recording whose images have no time. A single 0 is a valid time, as simulations start there.
    fn without_times(&mut self) -> Option<Error> {
        let are_untimed =
            |[timed, untimed]: [usize; 2]| untimed > 1 || self.ended && timed == 0 && untimed == 1;
        let side = self.timed.into_iter().position(are_untimed)?;
        (self.ended, self.error, self.pairing, self.timed) = (true, None, Pairing::new(0), [[0; 2]; 2]);
        self.count = self.count.max(1);
        let reason = format!(
            "images are paired by the time in their headers, but on {} that is 0; configure the camera driver to set it, \
             and record again",
            self.images.topics[side].name
        );
        Some(Error::read(&self.images.path, reason))
    }

    /// Notes a change of a camera's calibration. Malformed messages are ignored, as the first one was valid.
    fn check_camera(&self, side: usize, message: &Message) {
        let Some((topic, first)) = self.cameras.as_ref().map(|cameras| &cameras[side]) else { return };
        let Ok(now) = CameraInfo::decode(&message.data, message.encoding) else { return };
        let stamp = now.header.stamp;
        if (CameraInfo { header: first.header.clone(), ..now }) != *first {
            self.remarks.note(|noted| _ = noted.changed.get_or_insert((topic.clone(), stamp)));
        }
    }

    /// The error if no pair was found.
    fn without_pairs(&self) -> Error {
        let [l, r] = self.images.topics.each_ref().map(|topic| topic.name.as_str());
        let reason = match self.first {
            [Some(left), Some(right)] => format!(
                "no image of {l} has the same time as one of {r}: the first ones are at {left} and {right}; give --tolerance SECONDS if the \
                 cameras are not triggered together"
            ),
            [None, _] => format!("contains no image on {l}"),
            [_, None] => format!("contains no image on {r}"),
        };
        Error::read(&self.images.path, reason)
    }
}

impl Images {
    /// Adds the name of the message to an error.
    fn at(&self, message: &Message, reason: impl Into<mrfgs::error::Reason>) -> Error {
        Error::read(self.name_of(message), reason.into())
    }

    /// The name of a message in errors: file, topic and time.
    fn name_of(&self, message: &Message) -> PathBuf {
        let time = header(message).map(|header| format!(" at {}", header.stamp)).unwrap_or_default();
        format!("{}:{}{time}", self.path.display(), self.topics[message.topic].name).into()
    }

    fn view(&self, message: &Message) -> Result<Raster<'static>> {
        let kind = &self.topics[message.topic].kind;
        ros::view(kind, &message.data, message.encoding, self.reader, &self.name_of(message))
    }
}

impl Remarks {
    fn note(&self, change: impl FnOnce(&mut Noted)) {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// The remarks as text; `None` without any.
    pub(crate) fn said(&self) -> Option<String> {
        let Noted { tally, changed, missing } = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let Tally { alone: [left, right], repeated, late } = tally;
        let mut said = Vec::new();
        if let Some((claimed, found)) = missing {
            said.push(format!(
                "the recording contains {found} messages, but its metadata.yaml says {claimed}"
            ));
        }
        if left + right > 0 {
            said.push(format!("{left} left and {right} right image{} had no partner", plural(right)));
        }
        if repeated > 0 {
            said.push(format!("{repeated} image{} had the same time as another one", plural(repeated)));
        }
        if late > 0 {
            said.push(format!("{late} image{} came too late in the recording to be paired", plural(late)));
        }
        if let Some((topic, stamp)) = changed {
            said.push(format!(
                "the calibration on {topic} changes at {stamp}, but all frames were matched with the first one; match the rest as a \
                 separate recording"
            ));
        }
        (!said.is_empty()).then(|| said.join(", "))
    }
}

fn header(message: &Message) -> mrfgs_ros::messages::Result<Header> {
    Header::of(&message.data, message.encoding)
}

/// The first calibration of each camera; `None` if one is missing or empty.
fn cameras(recording: &Recording, chosen: &[Topic; 2]) -> Result<Option<[(String, CameraInfo); 2]>> {
    let infos = chosen.each_ref().map(|topic| topics::camera_info(recording.topics(), topic));
    let [Some(left), Some(right)] = infos else { return Ok(None) };
    let mut found: [Option<CameraInfo>; 2] = [None, None];
    // Ignore damage here; it is reported with the image that it affects.
    for message in recording.messages(&[&left.name, &right.name]).map_while(Result::ok) {
        let name = format!("{}:{}", recording.path().display(), [left, right][message.topic].name);
        let camera = CameraInfo::decode(&message.data, message.encoding);
        found[message.topic].get_or_insert(camera.map_err(|reason| Error::read(name, reason))?);
        if found.iter().all(Option::is_some) {
            break;
        }
    }
    let [l, r] = found;
    let found = l.zip(r).map(|(l, r)| [(left.name.clone(), l), (right.name.clone(), r)]);
    let is_rectified = chosen.iter().all(Topic::is_rectified);
    Ok(found.filter(|all| all.iter().all(|(_, camera)| ros::is_known(camera, is_rectified))))
}
