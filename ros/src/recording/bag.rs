//! Reads ROS 1 bags from start to end. (The crate `rosbag` maps the whole file, trusts lengths, and panics on bags that were not closed.)

use std::collections::HashMap;
use std::mem;

use mrfgs::Result;
use mrfgs::error::Reason;

use super::chunk::{Chunk, unpacked};
use super::file::{File, MAX_RECORD};
use super::message::{Message, Source, damage, topic};
use super::place::Place;
use crate::messages::Encoding;
use crate::topics::Topic;

/// The first bytes of a bag.
pub(super) const MAGIC: &[u8] = b"#ROSBAG V2.0\n";

/// The relevant kinds of records, in the field `op`.
const MESSAGE: u8 = 2;
const BAG: u8 = 3;
const CHUNK: u8 = 5;
const CONNECTION: u8 = 7;

/// A bag being read.
pub(super) struct Bag {
    file: File,
    wanted: Vec<String>,
    /// The topic of each connection: its index among all topics, and among the requested ones.
    connections: HashMap<u32, (usize, Option<usize>)>,
    topics: Vec<Topic>,
    chunk: Chunk,
    /// The end of the messages and start of the index; 0 if the bag was not closed.
    index: u64,
}

impl Bag {
    pub(super) fn open(place: &Place, wanted: Vec<String>) -> Result<Self> {
        let mut file = File::open(place)?;
        if file.left() < MAGIC.len() as u64 || file.take(MAGIC.len() as u64)? != MAGIC {
            return Err(file.error("is not a ROS 1 bag: it does not start with #ROSBAG V2.0"));
        }
        let mut bag = Self {
            file,
            wanted,
            connections: HashMap::new(),
            topics: Vec::new(),
            chunk: Chunk::default(),
            index: 0,
        };
        let head = bag.part()?;
        let _padding = bag.part()?;
        let fields = Fields::of(&head).map_err(|reason| bag.file.error(reason))?;
        if fields.kind() != Some(BAG) {
            return Err(bag.file.error("is a damaged bag: it does not start with its header"));
        }
        bag.index = fields.get("index_pos").map_or(0, number);
        Ok(bag)
    }

    /// The topics of a file.
    pub(super) fn topics(place: &Place) -> Result<Vec<Topic>> {
        let mut bag = Self::open(place, Vec::new())?;
        if bag.index > bag.file.at() && bag.index < bag.file.len() && bag.connections_of_index().is_ok() {
            return Ok(bag.topics);
        }
        let mut bag = Self::open(place, Vec::new())?;
        // Damage is reported when messages are read; everything before it is usable.
        match damage(&mut bag) {
            Some(error) if bag.topics.is_empty() => Err(error),
            _ => Ok(bag.topics),
        }
    }

    fn connections_of_index(&mut self) -> Result<()> {
        self.file.seek(self.index)?;
        while self.file.left() > 0 {
            let (head, body) = (self.part()?, self.part()?);
            self.put(&head, &body).map_err(|reason| self.file.error(reason))?;
        }
        Ok(())
    }

    /// Reads a length and the bytes after it.
    fn part(&mut self) -> Result<Vec<u8>> {
        let length = number(&self.file.take(4)?);
        self.file.take(length)
    }

    /// Handles a record other than a chunk. Returns its message, if that is on a requested topic.
    fn put(&mut self, head: &[u8], body: &[u8]) -> Result<Option<Message>, Reason> {
        let fields = Fields::of(head)?;
        let connection = || {
            fields.get("conn").map(|id| number(id) as u32).ok_or("contains a record without its connection")
        };
        match fields.kind() {
            Some(CONNECTION) => {
                let id = connection()?;
                let more = Fields::of(body)?;
                let name = fields
                    .get("topic")
                    .or(more.get("topic"))
                    .ok_or("contains a connection without a topic")?;
                let name = String::from_utf8_lossy(name).into_owned();
                let kind = String::from_utf8_lossy(more.get("type").unwrap_or_default());
                let wanted = self.wanted.iter().position(|one| *one == name);
                let known = self.topics.iter().position(|topic| topic.name == name);
                let topic = known.unwrap_or_else(|| {
                    self.topics.push(topic(name, &kind, Some(Encoding::Ros1)));
                    self.topics.len() - 1
                });
                self.connections.insert(id, (topic, wanted));
                Ok(None)
            }
            Some(MESSAGE) => {
                let id = connection()?;
                let Some((_, wanted)) = self.connections.get(&id) else {
                    return Err(format!("contains a message of the undefined connection {id}").into());
                };
                let message = |topic| Message { topic, encoding: Encoding::Ros1, data: body.to_vec() };
                Ok(wanted.map(message))
            }
            _ => Ok(None),
        }
    }
}

impl Source for Bag {
    fn message(&mut self) -> Result<Option<Message>> {
        loop {
            let mut chunk = mem::take(&mut self.chunk);
            let found = chunk.message(|records, at| {
                let (head, body, next) = record(records, at)?;
                Ok((self.put(head, body)?, next))
            });
            self.chunk = chunk;
            if let Some(message) = found.map_err(|reason| self.file.error(reason))? {
                return Ok(Some(message));
            }
            let start = self.file.at();
            if self.index > 0 && start >= self.index {
                return Ok(None);
            }
            if self.file.left() == 0 {
                return Err(self.file.error(
                    "is cut off: it has no index, so it was probably not closed; complete messages are used",
                ));
            }
            let (head, body) = (self.part()?, self.part()?);
            let kind = Fields::of(&head).map_err(|reason| self.file.error(reason))?.kind();
            if kind == Some(CHUNK) {
                let records = unpacked_chunk(&head, &body);
                let records = records
                    .map_err(|reason| self.file.error(format!("the chunk at byte {start} {reason}")))?;
                self.chunk = Chunk::new(records, start);
            } else if let Some(message) = self.put(&head, &body).map_err(|reason| self.file.error(reason))? {
                return Ok(Some(message));
            }
        }
    }
}

/// The records of a chunk with this head and body.
fn unpacked_chunk(head: &[u8], body: &[u8]) -> Result<Vec<u8>, Reason> {
    let fields = Fields::of(head)?;
    let method = String::from_utf8_lossy(fields.get("compression").unwrap_or_default());
    let size = fields.get("size").map_or(MAX_RECORD + 1, number);
    unpacked(body, &method, size)
}

/// The record at byte `at`: its head, its body, and the start of the next one.
fn record(bytes: &[u8], at: usize) -> Result<(&[u8], &[u8], usize), Reason> {
    let part = |at: usize| {
        let length = number(bytes.get(at..at.checked_add(4)?)?) as usize;
        let end = (at + 4).checked_add(length)?;
        Some((bytes.get(at + 4..end)?, end))
    };
    let whole = part(at).and_then(|(head, end)| part(end).map(|(body, next)| (head, body, next)));
    whole.ok_or_else(|| "ends in the middle of a record".into())
}

/// The fields of a head: `name=value`, each preceded by its length.
struct Fields<'a>(Vec<(&'a [u8], &'a [u8])>);

impl<'a> Fields<'a> {
    fn of(bytes: &'a [u8]) -> Result<Self, Reason> {
        let (mut fields, mut rest) = (Vec::new(), bytes);
        while !rest.is_empty() {
            let field = rest
                .split_at_checked(4)
                .and_then(|(length, rest)| rest.split_at_checked(number(length) as usize));
            let (field, after) = field.ok_or("contains a damaged record: a field has no end")?;
            let equals = field
                .iter()
                .position(|byte| *byte == b'=')
                .ok_or("contains a damaged record: a field has no name")?;
            fields.push((&field[..equals], &field[equals + 1..]));
            rest = after;
        }
        Ok(Self(fields))
    }

    fn get(&self, name: &str) -> Option<&'a [u8]> {
        self.0.iter().find(|(key, _)| *key == name.as_bytes()).map(|(_, value)| *value)
    }

    fn kind(&self) -> Option<u8> {
        self.get("op")?.first().copied()
    }
}

/// A little-endian number of up to eight bytes.
fn number(bytes: &[u8]) -> u64 {
    bytes.iter().take(8).rev().fold(0, |all, byte| all << 8 | u64::from(*byte))
}
