//! Subscriptions to the cameras, and the pairs that have arrived.

use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use mrfgs::Error;
use mrfgs::error::Reason;
use mrfgs_node::names::Names;
use mrfgs_node::topics::{Participant, Subscriptions};
use mrfgs_ros::messages::{CameraInfo, CompressedImage, Encoding, Header, Image, PointCloud2, Stamp, Type};
use mrfgs_ros::pairing::{Companions, LivePairing, Tally};
use mrfgs_ros::topics::Topic;

use crate::args::PRIOR_TOPIC;
use crate::failure::{Failure, Result};
use crate::sequences::known::SAME_TIME;
use crate::stop;

/// An error of the network.
pub(super) fn of_network(reason: impl Into<Reason>) -> Failure {
    Error::read("the network", reason.into()).into()
}

/// The topics of both cameras.
#[derive(Clone)]
pub(super) struct CameraTopics {
    images: [Topic; 2],
    infos: [String; 2],
    /// The topic of a lidar, if there is one.
    clouds: Option<String>,
}

/// A pair of images that has arrived.
pub(super) struct Arrived {
    pub(super) header: Header,
    /// The messages of both images.
    pub(super) images: [Vec<u8>; 2],
    /// The cloud at its time, if there is one.
    pub(super) cloud: Option<Arc<Vec<u8>>>,
    /// When the second image arrived.
    pub(super) at: Instant,
}

/// Counts since the start.
#[derive(Clone, Copy, Default)]
pub(super) struct Count {
    /// Images and calibrations of the left and the right camera.
    pub(super) images: [usize; 2],
    pub(super) infos: [usize; 2],
    /// Malformed messages.
    pub(super) unreadable: usize,
    /// Pairs dropped for newer ones.
    pub(super) replaced: usize,
    pub(super) tally: Tally,
}

#[derive(Default)]
struct State {
    /// The newest pair that has not been taken.
    pair: Option<Arrived>,
    infos: [Option<CameraInfo>; 2],
    clouds: Companions<Arc<Vec<u8>>>,
    count: Count,
    /// Topic and reason of a malformed message that was not reported yet.
    unreadable: Option<(usize, Reason)>,
    /// The topics on which others publish messages of other types, and these types.
    mistyped: Vec<(usize, Vec<String>)>,
}

/// Data shared by the receiving thread and the matching thread.
#[derive(Default)]
pub(super) struct Arrivals {
    state: Mutex<State>,
    has_pair: Condvar,
}

impl CameraTopics {
    pub(super) fn new(names: &Names, clouds: Option<&str>) -> Result<Self> {
        let named = |reason| Failure::usage("--remap", reason);
        let image = |name: &str| {
            let name = names.resolve(name).map_err(named)?;
            let kind = if name.ends_with("/compressed") { CompressedImage::NAME } else { Image::NAME };
            Ok::<_, Failure>(Topic { name, kind: kind.into(), encoding: Some(Encoding::Cdr), count: None })
        };
        let images = [image("left/image_raw")?, image("right/image_raw")?];
        if images[0].name == images[1].name {
            return Err(named(
                format!("both images are on {}; give each its own topic", images[0].name).into(),
            ));
        }
        // The topic beside the image, unless it is remapped itself.
        let info = |name: &str, image: &Topic| {
            let beside = image.camera_infos().pop().filter(|_| !names.remaps(name));
            beside.map_or_else(|| names.resolve(name).map_err(named), Ok)
        };
        let infos = [info("left/camera_info", &images[0])?, info("right/camera_info", &images[1])?];
        let resolved = |name| names.resolve(name).map_err(|reason| Failure::usage(PRIOR_TOPIC, reason));
        let clouds = clouds.map(resolved).transpose()?;
        Ok(Self { images, infos, clouds })
    }

    /// The image topic of the left (0) or right (1) camera.
    pub(super) fn image(&self, side: usize) -> &str {
        &self.images[side].name
    }

    /// The message type of the image topic.
    pub(super) fn kind(&self, side: usize) -> &str {
        &self.images[side].kind
    }

    /// The calibration topic.
    pub(super) fn info(&self, side: usize) -> &str {
        &self.infos[side]
    }

    /// Whether the images are rectified, according to the names of their topics.
    pub(super) fn are_rectified(&self) -> bool {
        self.images.iter().all(Topic::is_rectified)
    }

    /// The name and the type of a topic, by its number among the subscriptions.
    pub(super) fn topic(&self, number: usize) -> [&str; 2] {
        match number {
            side @ (0 | 1) => [self.image(side), self.kind(side)],
            2 | 3 => [self.info(number - 2), CameraInfo::NAME],
            _ => [self.clouds().unwrap_or_default(), PointCloud2::NAME],
        }
    }

    /// The topic of a lidar, if there is one.
    pub(super) fn clouds(&self) -> Option<&str> {
        self.clouds.as_deref()
    }

    /// The name of an image with this time in errors.
    pub(super) fn named(&self, side: usize, stamp: Stamp) -> PathBuf {
        format!("{} at {stamp}", self.image(side)).into()
    }

    /// Subscribes to the images, then to the calibrations and to a lidar.
    pub(super) fn subscribe(&self, participant: &Participant, reliable: bool) -> Result<Subscriptions> {
        let mut all = Subscriptions::new().map_err(of_network)?;
        for topic in &self.images {
            all.add(participant, &topic.name, &topic.kind, reliable).map_err(of_network)?;
        }
        for info in &self.infos {
            all.add(participant, info, CameraInfo::NAME, reliable).map_err(of_network)?;
        }
        if let Some(clouds) = &self.clouds {
            all.add(participant, clouds, PointCloud2::NAME, reliable).map_err(of_network)?;
        }
        Ok(all)
    }
}

impl Arrivals {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Receives messages until the user stops the program or the network fails; checks for a stop every `patience`.
    pub(super) fn receive(
        &self,
        mut subscriptions: Subscriptions,
        tolerance: u64,
        patience: Duration,
    ) -> mrfgs_node::topics::Result<()> {
        let mut pairing = LivePairing::new(tolerance);
        while stop::go_on().is_continue() {
            subscriptions.wait(patience, |topic, bytes| {
                let taken = match topic {
                    side @ (0 | 1) => self.add_image(side, bytes, &mut pairing),
                    2 | 3 => self.add_info(topic - 2, &bytes),
                    _ => self.add_cloud(bytes),
                };
                if let Err(reason) = taken {
                    let mut state = self.state();
                    state.count.unreadable += 1;
                    state.unreadable.get_or_insert((topic, reason));
                }
            })?;
            self.state().mistyped = subscriptions.mistyped();
        }
        Ok(())
    }

    fn add_image(
        &self,
        side: usize,
        bytes: Vec<u8>,
        pairing: &mut LivePairing<(Header, Vec<u8>)>,
    ) -> mrfgs_ros::messages::Result<()> {
        let header = Header::of(&bytes, Encoding::Cdr)?;
        if header.stamp.0 == 0 {
            return Err("has time 0 in its header, but images are paired by time".into());
        }
        let pair = pairing.add(side, header.stamp, (header, bytes));
        let mut state = self.state();
        state.count.images[side] += 1;
        state.count.tally = pairing.tally();
        if let Some([(_, (header, left)), (_, (_, right))]) = pair {
            let newest = Arrived { header, images: [left, right], cloud: None, at: Instant::now() };
            state.count.replaced += usize::from(state.pair.replace(newest).is_some());
            self.has_pair.notify_one();
        }
        Ok(())
    }

    fn add_info(&self, side: usize, bytes: &[u8]) -> mrfgs_ros::messages::Result<()> {
        let info = CameraInfo::decode(bytes, Encoding::Cdr)?;
        let mut state = self.state();
        state.count.infos[side] += 1;
        // Ignore the time, so that only changes of the camera count.
        state.infos[side] = Some(CameraInfo { header: Header::default(), ..info });
        Ok(())
    }

    fn add_cloud(&self, bytes: Vec<u8>) -> mrfgs_ros::messages::Result<()> {
        let Header { stamp, .. } = Header::of(&bytes, Encoding::Cdr)?;
        let count = bytes.len();
        self.state().clouds.add(stamp, Arc::new(bytes), count);
        Ok(())
    }

    /// The newest pair, with the cloud that fits it best by now; `None` if none arrives within `patience`.
    pub(super) fn next(&self, patience: Duration) -> Option<Arrived> {
        let state = self.state();
        let waited = self.has_pair.wait_timeout_while(state, patience, |state| state.pair.is_none());
        let mut state = waited.unwrap_or_else(PoisonError::into_inner).0;
        let pair = state.pair.take()?;
        let cloud = state.clouds.nearest(pair.header.stamp, SAME_TIME).map(Arc::clone);
        Some(Arrived { cloud, ..pair })
    }

    /// The last calibration of both cameras, if both have sent one.
    pub(super) fn cameras(&self) -> Option<[CameraInfo; 2]> {
        let [left, right] = self.state().infos.clone();
        Some([left?, right?])
    }

    /// Counts since the start.
    pub(super) fn count(&self) -> Count {
        self.state().count
    }

    /// The topics on which others publish messages of other types than are taken, and these types.
    pub(super) fn mistyped(&self) -> Vec<(usize, Vec<String>)> {
        self.state().mistyped.clone()
    }

    /// Takes the topic and reason of the first malformed message since the last call.
    pub(super) fn unreadable(&self) -> Option<(usize, Reason)> {
        self.state().unreadable.take()
    }
}
