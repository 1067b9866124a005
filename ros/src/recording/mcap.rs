//! Reads MCAP files from start to end.

use std::collections::HashMap;
use std::mem;

use mcap::MAGIC;
use mcap::records::{Record, op};
use mrfgs::Result;
use mrfgs::error::Reason;

use super::chunk::{Chunk, plain, unpacked};
use super::file::{File, MAX_RECORD};
use super::message::{Message, Source, damage, topic};
use super::place::Place;
use crate::messages::Encoding;
use crate::topics::Topic;

/// Bytes before a record's body: its kind in one byte, its length in eight.
const HEAD: u64 = 9;
/// Bytes of the last record: its head, two offsets and a checksum.
const FOOTER: u64 = HEAD + 20;

/// A file being read.
pub(super) struct Mcap {
    file: File,
    wanted: Vec<String>,
    schemas: HashMap<u16, String>,
    channels: HashMap<u16, Channel>,
    topics: Vec<Topic>,
    chunk: Chunk,
}

/// The topic of a channel.
#[derive(Clone, Copy)]
struct Channel {
    /// Its index among all topics, and among the requested ones.
    topic: usize,
    wanted: Option<usize>,
    encoding: Option<Encoding>,
}

impl Mcap {
    pub(super) fn open(place: &Place, wanted: Vec<String>) -> Result<Self> {
        let mut file = File::open(place)?;
        if file.left() < MAGIC.len() as u64 || file.take(MAGIC.len() as u64)? != MAGIC {
            return Err(file.error("is not an MCAP file: it does not start like one"));
        }
        Ok(Self {
            file,
            wanted,
            schemas: HashMap::new(),
            channels: HashMap::new(),
            topics: Vec::new(),
            chunk: Chunk::default(),
        })
    }

    /// The topics of a file.
    pub(super) fn topics(place: &Place) -> Result<Vec<Topic>> {
        let mut file = Self::open(place, Vec::new())?;
        if let Some(topics) = file.summary() {
            return Ok(topics);
        }
        let mut file = Self::open(place, Vec::new())?;
        // Damage is reported when messages are read; everything before it is usable.
        match damage(&mut file) {
            Some(error) if file.topics.is_empty() => Err(error),
            _ => Ok(file.topics),
        }
    }

    /// The topics from the summary at the end, if that is complete.
    fn summary(&mut self) -> Option<Vec<Topic>> {
        let end = self.file.len().checked_sub(FOOTER + MAGIC.len() as u64)?;
        self.file.seek(end).ok()?;
        let tail = self.file.take(self.file.left()).ok()?;
        if tail[0] != op::FOOTER || !tail.ends_with(MAGIC) {
            return None;
        }
        let Ok(Record::Footer(footer)) = parsed(op::FOOTER, &tail[HEAD as usize..FOOTER as usize]) else {
            return None;
        };
        let size = end.checked_sub(footer.summary_start).filter(|size| *size < MAX_RECORD)?;
        if footer.summary_start == 0 {
            return None;
        }
        self.file.seek(footer.summary_start).ok()?;
        let records = self.file.take(size).ok()?;
        let (mut at, mut counts) = (0, None);
        while at < records.len() {
            let (kind, body, next) = record(&records, at).ok()?;
            match kind {
                op::SCHEMA | op::CHANNEL => _ = self.put(kind, body).ok()?,
                op::STATISTICS => {
                    let Ok(Record::Statistics(statistics)) = parsed(kind, body) else { return None };
                    counts = Some(statistics.channel_message_counts);
                }
                _ => {}
            }
            at = next;
        }
        let mut topics = mem::take(&mut self.topics);
        for topic in &mut topics {
            topic.count = counts.as_ref().map(|_| 0);
        }
        for (id, count) in counts.into_iter().flatten() {
            if let Some(topic) = self.channels.get(&id).and_then(|channel| topics.get_mut(channel.topic)) {
                topic.count = topic.count.map(|all| all + count);
            }
        }
        (!topics.is_empty()).then_some(topics)
    }

    /// Handles a record other than a chunk. Returns its message, if that is on a requested topic.
    fn put(&mut self, kind: u8, body: &[u8]) -> Result<Option<Message>, Reason> {
        if ![op::SCHEMA, op::CHANNEL, op::MESSAGE].contains(&kind) {
            return Ok(None);
        }
        match parsed(kind, body) {
            Ok(Record::Schema { header, .. }) => {
                self.schemas.insert(header.id, header.name);
                Ok(None)
            }
            Ok(Record::Channel(channel)) => {
                let encoding = match channel.message_encoding.as_str() {
                    "cdr" => Some(Encoding::Cdr),
                    "ros1" => Some(Encoding::Ros1),
                    _ => None,
                };
                let kind = self.schemas.get(&channel.schema_id).map_or("", String::as_str);
                let wanted = self.wanted.iter().position(|name| *name == channel.topic);
                let known = self.topics.iter().position(|topic| topic.name == channel.topic);
                let topic = known.unwrap_or_else(|| {
                    let count = Some(0);
                    self.topics.push(Topic { count, ..topic(channel.topic, kind, encoding) });
                    self.topics.len() - 1
                });
                self.channels.insert(channel.id, Channel { topic, wanted, encoding });
                Ok(None)
            }
            Ok(Record::Message { header, data }) => {
                let Some(channel) = self.channels.get(&header.channel_id) else {
                    return Err(
                        format!("contains a message of the undefined channel {}", header.channel_id).into()
                    );
                };
                if let Some(count) = &mut self.topics[channel.topic].count {
                    *count += 1;
                }
                let (Some(topic), Some(encoding)) = (channel.wanted, channel.encoding) else {
                    return Ok(None);
                };
                let data =
                    plain(&data, encoding).map_err(|reason| format!("contains a message that {reason}"))?;
                Ok(Some(Message { topic, encoding, data }))
            }
            Ok(_) => Ok(None),
            Err(reason) => Err(format!("contains a damaged record: {reason}").into()),
        }
    }
}

impl Source for Mcap {
    fn message(&mut self) -> Result<Option<Message>> {
        loop {
            let mut chunk = mem::take(&mut self.chunk);
            let found = chunk.message(|records, at| {
                let (kind, body, next) = record(records, at)?;
                Ok((self.put(kind, body)?, next))
            });
            self.chunk = chunk;
            if let Some(message) = found.map_err(|reason| self.file.error(reason))? {
                return Ok(Some(message));
            }
            let start = self.file.at();
            if self.file.left() == 0 {
                return Err(self.file.error(
                    "is cut off: it has no end, so the recording was probably killed; complete messages are used",
                ));
            }
            let head = self.file.take(HEAD)?;
            let (kind, length) = (head[0], number(&head[1..]));
            match kind {
                op::DATA_END | op::FOOTER => return Ok(None),
                op::CHUNK => {
                    let body = self.file.take(length)?;
                    let records = unpacked_chunk(&body);
                    let records = records
                        .map_err(|reason| self.file.error(format!("the chunk at byte {start} {reason}")))?;
                    self.chunk = Chunk::new(records, start);
                }
                op::SCHEMA | op::CHANNEL | op::MESSAGE => {
                    let body = self.file.take(length)?;
                    let put = self.put(kind, &body);
                    if let Some(message) = put.map_err(|reason| self.file.error(reason))? {
                        return Ok(Some(message));
                    }
                }
                _ => self.file.skip(length)?,
            }
        }
    }
}

/// The records of a chunk with this body.
fn unpacked_chunk(body: &[u8]) -> Result<Vec<u8>, Reason> {
    let (header, data) = match parsed(op::CHUNK, body) {
        Ok(Record::Chunk { header, data }) => (header, data),
        Ok(_) => return Err("is damaged".into()),
        Err(reason) => return Err(format!("is damaged: {reason}").into()),
    };
    let records = unpacked(&data, &header.compression, header.uncompressed_size)?;
    // 0 means no checksum.
    if header.uncompressed_crc != 0 && crc32fast::hash(&records) != header.uncompressed_crc {
        return Err("is damaged: its checksum is wrong".into());
    }
    Ok(records)
}

/// Parses a record of this kind. The parser allocates the claimed length of a text, so texts are checked first.
fn parsed(kind: u8, body: &[u8]) -> Result<Record<'_>, Reason> {
    if texts_fit(kind, body).is_none() {
        return Err("a text has no end".into());
    }
    mcap::parse_record(kind, body).map_err(|error| Reason::from(first_line(&error.to_string())))
}

/// `Some` if all texts of a record end within it.
fn texts_fit(kind: u8, body: &[u8]) -> Option<()> {
    let text = |rest: &mut &[u8]| {
        let (length, after) = rest.split_at_checked(4)?;
        *rest = after.get(number(length) as usize..)?;
        Some(())
    };
    // The offset of the first text, and the number of texts.
    let (start, count) = match kind {
        op::SCHEMA => (2, 2),
        op::CHANNEL => (4, 2),
        op::CHUNK => (28, 1),
        _ => return Some(()),
    };
    let mut rest = body.get(start..)?;
    for _ in 0..count {
        text(&mut rest)?;
    }
    if kind == op::CHANNEL {
        // Pairs of texts, preceded by their total length.
        let (length, after) = rest.split_at_checked(4)?;
        let mut pairs = after.get(..number(length) as usize)?;
        while !pairs.is_empty() {
            text(&mut pairs)?;
            text(&mut pairs)?;
        }
    }
    Some(())
}

/// The record at byte `at`: its kind, its body, and the start of the next one.
fn record(bytes: &[u8], at: usize) -> Result<(u8, &[u8], usize), Reason> {
    let ends = || Reason::from("ends in the middle of a record");
    let (head, rest) = bytes[at..].split_at_checked(HEAD as usize).ok_or_else(ends)?;
    let length = usize::try_from(number(&head[1..])).map_err(|_| ends())?;
    let body = rest.get(..length).ok_or_else(ends)?;
    Ok((head[0], body, at + HEAD as usize + length))
}

fn number(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |all, byte| all << 8 | u64::from(*byte))
}

/// Errors of the parser have many lines.
fn first_line(text: &str) -> &str {
    text.lines()
        .map(str::trim)
        .find(|line| line.chars().any(char::is_alphabetic))
        .unwrap_or("it cannot be read")
}
