//! What comes out of a recording.

use crate::messages::Encoding;
use crate::topics::Topic;

/// A message of a topic that was asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Which of the topics that were asked for.
    pub topic: usize,
    /// How it is laid out.
    pub encoding: Encoding,
    /// Its bytes.
    pub data: Vec<u8>,
}

/// A topic that a file speaks of, whose type may be in the words of ROS 1.
pub(super) fn topic(name: String, kind: &str, encoding: Option<Encoding>) -> Topic {
    let kind = match kind.split_once('/') {
        Some((package, name)) if !name.contains('/') => format!("{package}/msg/{name}"),
        _ => kind.to_owned(),
    };
    Topic { name, kind, encoding, count: None }
}
