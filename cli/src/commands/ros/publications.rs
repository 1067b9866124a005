//! The topics that a node publishes.

use mrfgs::{Error, Result};
use mrfgs_node::names::Names;
use mrfgs_node::topics::{Participant, Publication};
use mrfgs_ros::messages::{Encode, Header};

use crate::failure::{self, Failure};
use crate::outputs::AlsoArgs;
use crate::outputs::messages::{self, Sink, Topic};

use super::arrivals::of_network;

/// The topics of disparities and of what is wanted beside them.
pub(super) struct Publications(Vec<(Topic, String, Publication)>);

impl Publications {
    /// On topics that are called by these `names`.
    pub(super) fn new(participant: &Participant, names: &Names, also: &AlsoArgs) -> failure::Result<Self> {
        let mut topics = vec![messages::DISPARITY];
        topics.extend(also.topics());
        let mut cameras: Vec<_> = topics.iter().copied().filter_map(messages::camera_of).collect();
        // One for depths in both units.
        cameras.dedup();
        topics.extend(cameras);
        let published = topics.into_iter().map(|topic| {
            let name = names.resolve(topic.0).map_err(|reason| Failure::usage("--remap", reason))?;
            let publication = participant.publish(&name, topic.1).map_err(of_network)?;
            Ok((topic, name, publication))
        });
        published.collect::<failure::Result<_>>().map(Self)
    }

    /// Their full names.
    pub(super) fn names(&self) -> Vec<&str> {
        self.0.iter().map(|(_, name, _)| name.as_str()).collect()
    }

    /// Each of them, in no order.
    pub(super) fn iter(&self) -> impl Iterator<Item = &Publication> {
        self.0.iter().map(|(.., publication)| publication)
    }

    /// Whether anybody listens to any of them. It takes in who has come and gone, so ask often.
    pub(super) fn have_listeners(&mut self) -> bool {
        // All are asked.
        self.0.iter_mut().fold(false, |any, (.., publication)| publication.has_listeners() || any)
    }

    /// Whether depths are among them, which come with their camera.
    pub(super) fn have_depth_camera(&self) -> bool {
        self.0.iter().any(|(topic, ..)| *topic == messages::DEPTH_CAMERA)
    }
}

impl Sink for Publications {
    /// Only what somebody listens to is laid out and sent.
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
