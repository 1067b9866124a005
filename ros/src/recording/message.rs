//! Messages of a recording.

use std::iter;

use mrfgs::{Error, Result};

use crate::messages::Encoding;
use crate::topics::Topic;

/// A message of a requested topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// The index of its topic among the requested ones.
    pub topic: usize,
    /// Its serialization.
    pub encoding: Encoding,
    /// Its bytes.
    pub data: Vec<u8>,
}

/// Reads the messages of a file.
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

/// Reads a source to its end, and returns its error, if any.
pub(super) fn damage(source: &mut impl Source) -> Option<Error> {
    loop {
        match source.message() {
            Ok(Some(_)) => {}
            Ok(None) => return None,
            Err(error) => return Some(error),
        }
    }
}

/// A topic in a file, whose type may be in ROS 1's notation.
pub(super) fn topic(name: String, kind: &str, encoding: Option<Encoding>) -> Topic {
    let kind = match kind.split_once('/') {
        Some((package, name)) if !name.contains('/') => format!("{package}/msg/{name}"),
        _ => kind.to_owned(),
    };
    Topic { name, kind, encoding, count: None }
}
