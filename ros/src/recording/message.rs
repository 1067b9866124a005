//! What comes out of a recording.

use std::iter;

use mrfgs::{Error, Result};

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

/// What reads the messages of a file.
pub(super) trait Source {
    /// The next message; `None` after the last one.
    fn message(&mut self) -> Result<Option<Message>>;
}

/// The messages of a source, up to its end or its first error.
pub(super) fn messages(mut source: impl Source) -> impl Iterator<Item = Result<Message>> {
    let mut ended = false;
    iter::from_fn(move || {
        if ended {
            return None;
        }
        let message = source.message();
        ended = !matches!(message, Ok(Some(_)));
        message.transpose()
    })
}

/// Reads a source to its end. Returns what is wrong with it.
pub(super) fn damage(source: &mut impl Source) -> Option<Error> {
    loop {
        match source.message() {
            Ok(Some(_)) => {}
            Ok(None) => return None,
            Err(error) => return Some(error),
        }
    }
}

/// A topic that a file speaks of, whose type may be in the words of ROS 1.
pub(super) fn topic(name: String, kind: &str, encoding: Option<Encoding>) -> Topic {
    let kind = match kind.split_once('/') {
        Some((package, name)) if !name.contains('/') => format!("{package}/msg/{name}"),
        _ => kind.to_owned(),
    };
    Topic { name, kind, encoding, count: None }
}
