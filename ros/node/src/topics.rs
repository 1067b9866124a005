//! Subscriptions and publications over DDS.

use std::collections::HashMap;
use std::convert::Infallible;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use bytes::Bytes;
use mio::{Events, Interest, Poll, Token};
use mrfgs::error::Reason;
use mrfgs_ros::messages::{Encode, NodeEntitiesInfo, ParticipantEntitiesInfo, Type};
use rustdds::dds::WriteError;
use rustdds::no_key::{
    DataReader, DataWriter, Decode, DefaultDecoder, DeserializerAdapter, SerializerAdapter,
};
use rustdds::policy::{Durability, History, Reliability, ResourceLimits};
use rustdds::{
    DataWriterStatus, DomainParticipant, DomainParticipantBuilder, DomainParticipantStatusEvent, GUID,
    Publisher, QosPolicies, QosPolicyBuilder, RTPSEntity, RepresentationIdentifier, StatusEvented,
    Subscriber, Topic, TopicKind,
};

/// The largest domain for `ROS_DOMAIN_ID`.
pub const MOST_DOMAIN: u16 = 232;
/// Length of the header of a message, which states its serialization.
const HEAD: usize = 4;
/// The topic on which participants announce their nodes.
const GRAPH: &str = "ros_discovery_info";
/// Bytes of an identifier in ROS 2 since Iron.
pub const GID_BYTES: usize = 16;
/// Bytes of an identifier in Humble and earlier.
pub const LONG_GID_BYTES: usize = 24;
/// Queue length of a subscription, as in ROS's sensor profile.
const WAITING: i32 = 5;
/// Number of messages that a publication keeps for retransmission.
const SENT: i32 = 2;
/// Maximum number of unconfirmed messages, about two seconds at typical rates.
const UNCONFIRMED: i32 = 64;
/// How long a publication waits for subscribers before it drops a message.
const PATIENCE: rustdds::Duration = rustdds::Duration::from_millis(20);

/// A result of DDS.
pub type Result<T> = std::result::Result<T, Reason>;

/// A participant in a DDS domain, which discovers the others automatically.
pub struct Participant {
    inner: DomainParticipant,
    writers: Arc<Writers>,
    subscriber: Subscriber,
    publisher: Publisher,
}

impl Participant {
    /// Joins `domain`: 0 to [`MOST_DOMAIN`].
    ///
    /// # Errors
    /// If the network cannot be used.
    pub fn new(domain: u16) -> Result<Self> {
        let inner = DomainParticipantBuilder::new(domain).build().map_err(failed)?;
        let qos = QosPolicyBuilder::new().build();
        let subscriber = inner.create_subscriber(&qos).map_err(failed)?;
        let publisher = inner.create_publisher(&qos).map_err(failed)?;
        Ok(Self { inner, writers: Arc::default(), subscriber, publisher })
    }

    /// The topic with the full name `name` and message type `kind`, such as `sensor_msgs/msg/Image`.
    fn topic(&self, name: &str, kind: &str, qos: &QosPolicies) -> Result<Topic> {
        self.inner.create_topic(full(name), in_dds(kind), qos, TopicKind::NoKey).map_err(failed)
    }

    /// Publishes messages of type `kind` on the topic with the full name `name`, reliably for subscribers that ask for it.
    ///
    /// # Errors
    /// If DDS fails.
    pub fn publish(&self, name: &str, kind: &str) -> Result<Publication> {
        let qos = qos(Reliability::Reliable { max_blocking_time: PATIENCE }, SENT, UNCONFIRMED);
        let topic = self.topic(name, kind, &qos)?;
        let writer = self.publisher.create_datawriter_no_key(&topic, Some(qos)).map_err(failed)?;
        Ok(Publication { writer, listeners: 0, _participant: self.inner.clone() })
    }

    /// Announces this participant to ROS tools as the node `name` in `namespace`, as long as the result is kept. Identifiers have
    /// `gid_bytes` bytes: [`GID_BYTES`], or [`LONG_GID_BYTES`] for older releases.
    ///
    /// # Errors
    /// If DDS fails.
    pub fn announce<'a>(
        &self,
        [namespace, name]: [&str; 2],
        gid_bytes: usize,
        publications: impl Iterator<Item = &'a Publication>,
        subscriptions: &Subscriptions,
    ) -> Result<Announcement> {
        let gid = |guid: GUID| {
            let mut gid = guid.to_bytes().to_vec();
            gid.resize(gid_bytes, 0);
            gid
        };
        let node = NodeEntitiesInfo {
            namespace: namespace.into(),
            name: name.into(),
            readers: subscriptions.of.iter().map(|one| gid(one.reader.guid())).collect(),
            writers: publications.map(|publication| gid(publication.writer.guid())).collect(),
        };
        let told = ParticipantEntitiesInfo { gid: gid(self.inner.guid()), nodes: vec![node] };
        let qos = QosPolicyBuilder::new()
            .reliability(Reliability::Reliable { max_blocking_time: PATIENCE })
            // Late joiners get it too.
            .durability(Durability::TransientLocal)
            .history(History::KeepLast { depth: 1 })
            .build();
        let kind = in_dds(ParticipantEntitiesInfo::NAME);
        let topic = self.inner.create_topic(GRAPH.into(), kind, &qos, TopicKind::NoKey).map_err(failed)?;
        let writer = self.publisher.create_datawriter_no_key(&topic, Some(qos)).map_err(failed)?;
        let publication = Publication { writer, listeners: 0, _participant: self.inner.clone() };
        publication.send(told.encode())?;
        Ok(Announcement { _publication: publication })
    }
}

/// The DDS name of a ROS topic, such as `rt/disparity`.
fn full(name: &str) -> String {
    format!("rt{name}")
}

/// A type's name in DDS: `sensor_msgs::msg::dds_::Image_`.
fn in_dds(kind: &str) -> String {
    let (package, own) = kind.rsplit_once('/').unwrap_or(("", kind));
    format!("{}::dds_::{own}_", package.replace('/', "::"))
}

/// The type that ROS calls `kind` in DDS, as `sensor_msgs/msg/Image`; one that is not of ROS stays as it is.
fn in_ros(kind: &str) -> String {
    let parts =
        kind.split_once("::dds_::").and_then(|(package, own)| Some((package, own.strip_suffix('_')?)));
    parts.map_or_else(|| kind.into(), |(package, own)| format!("{}/{own}", package.replace("::", "/")))
}

/// The quality of service of a topic that keeps `depth` messages, and at most `most` until they are confirmed or taken.
fn qos(reliability: Reliability, depth: i32, most: i32) -> QosPolicies {
    let qos = QosPolicyBuilder::new().reliability(reliability).durability(Durability::Volatile);
    let limits = ResourceLimits { max_samples: most, max_instances: 1, max_samples_per_instance: most };
    qos.history(History::KeepLast { depth }).resource_limits(limits).build()
}

fn failed(error: impl std::fmt::Display) -> Reason {
    format!("DDS: {error}").into()
}

/// A message serialized as in [`mrfgs_ros::messages`], including its header.
struct Message(Vec<u8>);

/// Passes serialized messages through unchanged.
#[derive(Clone)]
struct AsTheyAre;

impl<'a> Decode<'a, Message> for AsTheyAre {
    type Error = Infallible;

    fn decode_bytes(
        self,
        content: &'a [u8],
        encoding: RepresentationIdentifier,
    ) -> std::result::Result<Message, Infallible> {
        let mut bytes = Vec::with_capacity(HEAD + content.len());
        bytes.extend([0, u8::from(encoding == RepresentationIdentifier::CDR_LE), 0, 0]);
        bytes.extend_from_slice(content);
        Ok(Message(bytes))
    }
}

impl DeserializerAdapter<Message> for AsTheyAre {
    type Error = Infallible;
    type Decoded = Message;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[RepresentationIdentifier::CDR_LE, RepresentationIdentifier::CDR_BE]
    }

    fn transform_decoded(decoded: Message) -> Message {
        decoded
    }
}

impl DefaultDecoder<Message> for AsTheyAre {
    type Decoder = Self;

    const DECODER: Self = Self;
}

impl SerializerAdapter<Bytes> for AsTheyAre {
    type Error = Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(content: &Bytes) -> std::result::Result<Bytes, Infallible> {
        Ok(content.clone())
    }
}

/// A published topic.
pub struct Publication {
    writer: DataWriter<Bytes, AsTheyAre>,
    listeners: usize,
    /// Keeps the participant alive, without which nothing is sent.
    _participant: DomainParticipant,
}

impl Publication {
    /// Whether there are subscribers. The call processes arrivals and departures, so call it often.
    pub fn has_listeners(&mut self) -> bool {
        while let Some(status) = self.writer.try_recv_status() {
            if let DataWriterStatus::PublicationMatched { current, .. } = status {
                self.listeners = current.count().max(0).unsigned_abs() as usize;
            }
        }
        self.listeners > 0
    }

    /// Sends a message encoded by [`Encode`].
    ///
    /// # Errors
    /// If subscribers are too slow, or DDS fails.
    pub fn send(&self, message: Vec<u8>) -> Result<()> {
        let message = Bytes::from(message);
        let content = message.slice(HEAD.min(message.len())..);
        self.writer.write(content, None).map_err(|error| match error {
            WriteError::WouldBlock { .. } => "its subscribers do not confirm messages".into(),
            error => failed(error),
        })
    }
}

/// Keeps a node announced to ROS tools.
pub struct Announcement {
    _publication: Publication,
}

/// The publishers in a domain, each with the DDS names of its topic and its type.
#[derive(Default)]
struct Writers(Mutex<HashMap<GUID, [String; 2]>>);

impl Writers {
    fn known(&self) -> MutexGuard<'_, HashMap<GUID, [String; 2]>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes in who has come and gone.
    fn follow(&self, participant: &DomainParticipant) {
        while let Some(event) = participant.status_listener().try_recv_status() {
            match event {
                DomainParticipantStatusEvent::WriterDetected { writer } => {
                    self.known().insert(writer.guid, [writer.topic_name, writer.type_name]);
                }
                DomainParticipantStatusEvent::WriterLost { guid, .. } => {
                    self.known().remove(&guid);
                }
                _ => {}
            }
        }
    }
}

/// One topic that is subscribed to.
struct Subscription {
    reader: DataReader<Message, AsTheyAre>,
    /// The topic and its type, as DDS calls them.
    called: [String; 2],
    /// Nothing comes without it.
    participant: DomainParticipant,
    writers: Arc<Writers>,
}

impl Subscription {
    /// The types of other messages that are published on its topic.
    fn others(&self) -> Vec<String> {
        let [topic, kind] = &self.called;
        let known = self.writers.known();
        let others = known.values().filter(|[of, other]| of == topic && other != kind);
        let mut others: Vec<_> = others.map(|[_, other]| in_ros(other)).collect();
        others.sort();
        others.dedup();
        others
    }
}

/// Subscriptions of one thread, which waits for all of them together.
pub struct Subscriptions {
    of: Vec<Subscription>,
    poll: Poll,
    events: Events,
}

impl Subscriptions {
    /// An empty set of subscriptions.
    ///
    /// # Errors
    /// If the system provides no polling.
    pub fn new() -> Result<Self> {
        let poll = Poll::new().map_err(failed)?;
        Ok(Self { of: Vec::new(), poll, events: Events::with_capacity(16) })
    }

    /// Subscribes to the topic with the full name `name` and message type `kind`. A `reliable` subscription only receives from publishers
    /// that retransmit lost messages.
    ///
    /// # Errors
    /// If DDS fails.
    pub fn add(&mut self, to: &Participant, name: &str, kind: &str, reliable: bool) -> Result<()> {
        let reliability = if reliable {
            Reliability::Reliable { max_blocking_time: PATIENCE }
        } else {
            Reliability::BestEffort
        };
        let qos = qos(reliability, WAITING, WAITING);
        let topic = to.topic(name, kind, &qos)?;
        let mut reader = to.subscriber.create_datareader_no_key(&topic, Some(qos)).map_err(failed)?;
        let token = Token(self.of.len());
        self.poll.registry().register(&mut reader, token, Interest::READABLE).map_err(failed)?;
        let (called, participant, writers) =
            ([full(name), in_dds(kind)], to.inner.clone(), Arc::clone(&to.writers));
        self.of.push(Subscription { reader, called, participant, writers });
        Ok(())
    }

    /// Waits up to `patience` for messages and passes them on: the number of the topic, in the order of adding, and the bytes as in
    /// [`mrfgs_ros::messages`].
    ///
    /// # Errors
    /// If DDS fails permanently.
    pub fn wait(&mut self, patience: Duration, mut take: impl FnMut(usize, Vec<u8>)) -> Result<()> {
        match self.poll.poll(&mut self.events, Some(patience)) {
            Err(error) if error.kind() != std::io::ErrorKind::Interrupted => return Err(failed(error)),
            _ => {}
        }
        // All are asked, whatever the events say: one that was missed would wait for the next message.
        for (number, Subscription { reader, called, participant, writers }) in self.of.iter_mut().enumerate()
        {
            while let Some(sample) = reader.take_next_sample().map_err(failed)? {
                writers.follow(participant);
                let writer = sample.sample_info().writer_guid();
                // This DDS hands on whatever comes on a topic of that name.
                if writers.known().get(&writer).is_none_or(|[_, kind]| *kind == called[1]) {
                    take(number, sample.into_value().0);
                }
            }
        }
        Ok(())
    }

    /// The topics on which messages of other types are published than were subscribed to: the number of each, in the order in which they were
    /// added, and the types that others publish.
    pub fn mistyped(&self) -> Vec<(usize, Vec<String>)> {
        self.of.iter().for_each(|one| one.writers.follow(&one.participant));
        let others = self.of.iter().map(Subscription::others).enumerate();
        others.filter(|(_, others)| !others.is_empty()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_have_two_names() {
        for kind in ["sensor_msgs/msg/Image", "stereo_msgs/msg/DisparityImage"] {
            assert_eq!(in_ros(&in_dds(kind)), kind);
        }
        assert_eq!(in_dds("sensor_msgs/msg/Image"), "sensor_msgs::msg::dds_::Image_");
        assert_eq!(in_ros("HelloWorld"), "HelloWorld");
    }
}
