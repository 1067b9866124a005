//! The topics that a node publishes.

use mrfgs::{Error, Result};
use mrfgs_node::names::Names;
use mrfgs_node::topics::{Participant, Publication};
use mrfgs_ros::messages::{CameraInfo, Encode, Header, Type};

use crate::failure::{self, Failure};
use crate::outputs::AlsoArgs;
use crate::outputs::messages::{self, Sink, Topic};

use super::arrivals::of_network;

/// The camera of the depths, where ROS looks for it.
pub(super) const DEPTH_CAMERA: Topic = ("depth/camera_info", CameraInfo::NAME);

/// The disparity topic and the topics of the selected outputs.
pub(super) struct Publications(Vec<(Topic, String, Publication)>);

impl Publications {
    /// Creates the publications; `names` resolves their topics.
    pub(super) fn new(participant: &Participant, names: &Names, also: &AlsoArgs) -> failure::Result<Self> {
        let mut topics = vec![messages::DISPARITY];
        topics.extend(also.topics());
        let mut cameras: Vec<_> = topics.iter().copied().filter_map(camera_of).collect();
        // Both units of depth share one camera topic.
        cameras.dedup();
        topics.extend(cameras);
        let published = topics.into_iter().map(|topic| {
            let name = names.resolve(topic.0).map_err(|reason| Failure::usage("--remap", reason))?;
            let publication = participant.publish(&name, topic.1).map_err(of_network)?;
            Ok((topic, name, publication))
        });
        published.collect::<failure::Result<_>>().map(Self)
    }

    /// The full names of the topics.
    pub(super) fn names(&self) -> Vec<&str> {
        self.0.iter().map(|(_, name, _)| name.as_str()).collect()
    }

    /// All publications, in no particular order.
    pub(super) fn iter(&self) -> impl Iterator<Item = &Publication> {
        self.0.iter().map(|(.., publication)| publication)
    }

    /// Whether any topic has a subscriber. The call processes arrivals and departures, so call it often.
    pub(super) fn have_listeners(&mut self) -> bool {
        // Ask every publication, without short-circuiting.
        self.0.iter_mut().fold(false, |any, (.., publication)| publication.has_listeners() || any)
    }

    /// Whether depths are published, which come with a camera.
    pub(super) fn have_depth_camera(&self) -> bool {
        self.0.iter().any(|(topic, ..)| *topic == DEPTH_CAMERA)
    }
}

impl Sink for Publications {
    /// Encodes and sends a message only if its topic has a subscriber.
    fn put(&mut self, topic: Topic, _: &Header, message: &impl Encode) -> Result<()> {
        let Some((_, name, publication)) = self.0.iter_mut().find(|(known, ..)| *known == topic) else {
            return Ok(());
        };
        if publication.has_listeners() {
            publication.send(message.encode()).map_err(|reason| Error::write(name, reason))?;
        }
        Ok(())
    }
}

/// The camera topic that accompanies depths on `topic`; `None` for other topics.
fn camera_of(topic: Topic) -> Option<Topic> {
    match topic {
        messages::DEPTH | messages::MILLIMETRES => Some(DEPTH_CAMERA),
        messages::REGISTERED | messages::REGISTERED_MILLIMETRES => Some(messages::REGISTERED_CAMERA),
        _ => None,
    }
}
