//! Writes MCAP files. (The crate `mcap` needs C libraries to compress chunks.)

use std::collections::BTreeMap;
use std::io::{self, Write};

use lz4_flex::frame::FrameEncoder;
use mcap::MAGIC;
use mcap::records::op;

use crate::messages::{Encode, Stamp, definition};

/// Minimum bytes of a chunk before compression, except for the last one.
const CHUNK: usize = 1 << 22;

/// Writes a ROS 2 MCAP file with LZ4 chunks, their indexes and a summary. [`finish`](Self::finish) completes it.
pub struct Writer<W> {
    to: W,
    /// Bytes written so far, and their checksum.
    at: u64,
    checksum: crc32fast::Hasher,
    /// The records of types and topics so far, with their names.
    schemas: Vec<(&'static str, Vec<u8>)>,
    channels: Vec<Channel>,
    chunk: Vec<u8>,
    /// Time and offset of each channel's messages in the chunk.
    places: BTreeMap<u16, Vec<(u64, u64)>>,
    /// The index records of the chunks.
    chunks: Vec<Vec<u8>>,
    /// The first and the last time of all messages.
    times: Option<[u64; 2]>,
    chunk_times: Option<[u64; 2]>,
}

struct Channel {
    topic: String,
    record: Vec<u8>,
    count: u64,
}

impl<W: Write> Writer<W> {
    /// Begins the file.
    ///
    /// # Errors
    /// Errors of `to`.
    pub fn new(to: W) -> io::Result<Self> {
        let mut writer = Self {
            to,
            at: 0,
            checksum: crc32fast::Hasher::new(),
            schemas: Vec::new(),
            channels: Vec::new(),
            chunk: Vec::new(),
            places: BTreeMap::new(),
            chunks: Vec::new(),
            times: None,
            chunk_times: None,
        };
        writer.put(MAGIC)?;
        let mut header = Vec::new();
        text(&mut header, "ros2");
        text(&mut header, concat!("mrfgs ", env!("CARGO_PKG_VERSION")));
        writer.record(op::HEADER, &header)?;
        Ok(writer)
    }

    /// Adds a message on `topic`, seen at `stamp`. All messages of a topic must have the same type.
    ///
    /// # Errors
    /// Errors of writing.
    pub fn add<M: Encode>(&mut self, topic: &str, stamp: Stamp, message: &M) -> io::Result<()> {
        let channel = self.channel::<M>(topic);
        let time = u64::try_from(stamp.0).unwrap_or(0);
        let number = self.channels[usize::from(channel) - 1].count as u32;
        self.channels[usize::from(channel) - 1].count += 1;
        self.places.entry(channel).or_default().push((time, self.chunk.len() as u64));
        let body = [
            &channel.to_le_bytes()[..],
            &number.to_le_bytes(),
            &time.to_le_bytes(),
            &time.to_le_bytes(),
            &message.encode(),
        ]
        .concat();
        push(&mut self.chunk, op::MESSAGE, &body);
        for times in [&mut self.times, &mut self.chunk_times] {
            let [first, last] = times.unwrap_or([time; 2]);
            *times = Some([first.min(time), last.max(time)]);
        }
        if self.chunk.len() >= CHUNK { self.end_chunk() } else { Ok(()) }
    }

    /// The number of a topic; its definition is written before its first message.
    fn channel<M: Encode>(&mut self, topic: &str) -> u16 {
        if let Some(at) = self.channels.iter().position(|channel| channel.topic == topic) {
            return at as u16 + 1;
        }
        let schema = self.schemas.iter().position(|(name, _)| *name == M::NAME).unwrap_or_else(|| {
            let mut record = (self.schemas.len() as u16 + 1).to_le_bytes().to_vec();
            text(&mut record, M::NAME);
            text(&mut record, "ros2msg");
            text(&mut record, &definition(M::NAME));
            push(&mut self.chunk, op::SCHEMA, &record);
            self.schemas.push((M::NAME, record));
            self.schemas.len() - 1
        });
        let id = self.channels.len() as u16 + 1;
        let mut record = id.to_le_bytes().to_vec();
        record.extend((schema as u16 + 1).to_le_bytes());
        text(&mut record, topic);
        text(&mut record, "cdr");
        // No metadata.
        record.extend(0_u32.to_le_bytes());
        push(&mut self.chunk, op::CHANNEL, &record);
        self.channels.push(Channel { topic: topic.into(), record, count: 0 });
        id
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.to.write_all(bytes)?;
        self.checksum.update(bytes);
        self.at += bytes.len() as u64;
        Ok(())
    }

    fn record(&mut self, kind: u8, body: &[u8]) -> io::Result<()> {
        let mut record = Vec::with_capacity(body.len() + 9);
        push(&mut record, kind, body);
        self.put(&record)
    }

    fn end_chunk(&mut self) -> io::Result<()> {
        let Some([first, last]) = self.chunk_times.take() else { return Ok(()) };
        let records = std::mem::take(&mut self.chunk);
        let mut packer = FrameEncoder::new(Vec::new());
        packer.write_all(&records)?;
        let packed = packer.finish().map_err(io::Error::other)?;
        let start = self.at;
        let mut chunk = [first, last, records.len() as u64].map(u64::to_le_bytes).concat();
        chunk.extend(crc32fast::hash(&records).to_le_bytes());
        text(&mut chunk, "lz4");
        chunk.extend((packed.len() as u64).to_le_bytes());
        chunk.extend(&packed);
        self.record(op::CHUNK, &chunk)?;
        let chunk_length = self.at - start;
        let mut places = Vec::new();
        for (channel, messages) in std::mem::take(&mut self.places) {
            places.extend(channel.to_le_bytes());
            places.extend(self.at.to_le_bytes());
            let mut index = channel.to_le_bytes().to_vec();
            let all = messages.iter().flat_map(|(time, place)| [*time, *place]);
            list(&mut index, &all.flat_map(u64::to_le_bytes).collect::<Vec<_>>());
            self.record(op::MESSAGE_INDEX, &index)?;
        }
        let mut about = [first, last, start, chunk_length].map(u64::to_le_bytes).concat();
        list(&mut about, &places);
        about.extend((self.at - start - chunk_length).to_le_bytes());
        text(&mut about, "lz4");
        about.extend((packed.len() as u64).to_le_bytes());
        about.extend((records.len() as u64).to_le_bytes());
        self.chunks.push(about);
        Ok(())
    }

    /// Completes the file.
    ///
    /// # Errors
    /// Errors of writing.
    pub fn finish(mut self) -> io::Result<W> {
        self.end_chunk()?;
        let checksum = self.checksum.clone().finalize();
        self.record(op::DATA_END, &checksum.to_le_bytes())?;
        let start = self.at;
        self.checksum = crc32fast::Hasher::new();
        let statistics = self.statistics();
        let groups = [
            (op::SCHEMA, self.schemas.iter().map(|(_, record)| record.clone()).collect()),
            (op::CHANNEL, self.channels.iter().map(|channel| channel.record.clone()).collect()),
            (op::STATISTICS, vec![statistics]),
            (op::CHUNK_INDEX, std::mem::take(&mut self.chunks)),
        ];
        let mut offsets = Vec::new();
        for (kind, records) in groups {
            let before = self.at;
            for record in &records {
                self.record(kind, record)?;
            }
            if !records.is_empty() {
                let place = [before, self.at - before].map(u64::to_le_bytes).concat();
                offsets.push([&[kind], &place[..]].concat());
            }
        }
        let offsets_start = self.at;
        for offset in offsets {
            self.record(op::SUMMARY_OFFSET, &offset)?;
        }
        let places = [start, offsets_start].map(u64::to_le_bytes).concat();
        // The checksum includes the footer up to itself.
        self.put(&[&[op::FOOTER][..], &20_u64.to_le_bytes(), &places].concat())?;
        let checksum = self.checksum.clone().finalize();
        self.put(&checksum.to_le_bytes())?;
        self.put(MAGIC)?;
        self.to.flush()?;
        Ok(self.to)
    }

    fn statistics(&self) -> Vec<u8> {
        let [first, last] = self.times.unwrap_or_default();
        let count: u64 = self.channels.iter().map(|channel| channel.count).sum();
        let mut record = count.to_le_bytes().to_vec();
        record.extend((self.schemas.len() as u16).to_le_bytes());
        // Channels, attachments, metadata and chunks.
        let counts = [self.channels.len(), 0, 0, self.chunks.len()];
        record.extend(counts.into_iter().flat_map(|count| (count as u32).to_le_bytes()));
        record.extend([first, last].into_iter().flat_map(u64::to_le_bytes));
        let mut counts = Vec::new();
        for (i, channel) in self.channels.iter().enumerate() {
            counts.extend((i as u16 + 1).to_le_bytes());
            counts.extend(channel.count.to_le_bytes());
        }
        list(&mut record, &counts);
        record
    }
}

/// Adds a record.
fn push(to: &mut Vec<u8>, kind: u8, body: &[u8]) {
    to.push(kind);
    to.extend((body.len() as u64).to_le_bytes());
    to.extend(body);
}

/// Adds bytes, preceded by their number.
fn list(to: &mut Vec<u8>, bytes: &[u8]) {
    to.extend((bytes.len() as u32).to_le_bytes());
    to.extend(bytes);
}

fn text(to: &mut Vec<u8>, text: &str) {
    list(to, text.as_bytes());
}
