//! The compressed parts of recordings.

use std::io::Read;

use bzip2::read::BzDecoder;
use lz4_flex::frame::FrameDecoder;
use mrfgs::error::Reason;
use ruzstd::decoding::StreamingDecoder;

use super::file::MAX_RECORD;
use super::message::Message;
use super::place::ZSTD;
use crate::messages::Encoding;

/// The records of a chunk, consumed one by one.
#[derive(Default)]
pub(super) struct Chunk {
    records: Vec<u8>,
    /// The position of the next record.
    at: usize,
    /// The offset of the chunk in the file.
    start: u64,
}

impl Chunk {
    pub(super) fn new(records: Vec<u8>, start: u64) -> Self {
        Self { records, at: 0, start }
    }

    /// The next message. `take` handles the record at a position and returns the start of the next one.
    ///
    /// # Errors
    /// Errors of `take`, worded to follow the file name.
    pub(super) fn message(
        &mut self,
        mut take: impl FnMut(&[u8], usize) -> Result<(Option<Message>, usize), Reason>,
    ) -> Result<Option<Message>, Reason> {
        while self.at < self.records.len() {
            let taken = take(&self.records, self.at);
            let (message, next) =
                taken.map_err(|reason| Reason::from(format!("the chunk at byte {} {reason}", self.start)))?;
            self.at = next;
            if message.is_some() {
                return Ok(message);
            }
        }
        Ok(None)
    }
}

/// Decompresses `packed` with the named method to the claimed `size` in bytes.
///
/// # Errors
/// If that fails, worded to follow the file name.
pub(super) fn unpacked(packed: &[u8], method: &str, size: u64) -> Result<Vec<u8>, Reason> {
    if size > MAX_RECORD {
        return Err(format!("claims {size} bytes, but at most {MAX_RECORD} are decompressed at once").into());
    }
    let mut bytes = Vec::new();
    let read = match method {
        "" | "none" => packed.take(size + 1).read_to_end(&mut bytes),
        "lz4" => FrameDecoder::new(packed).take(size + 1).read_to_end(&mut bytes),
        "bz2" => BzDecoder::new(packed).take(size + 1).read_to_end(&mut bytes),
        "zstd" => match StreamingDecoder::new(packed) {
            Ok(from) => from.take(size + 1).read_to_end(&mut bytes),
            Err(error) => return Err(format!("is not zstd: {error}").into()),
        },
        other => {
            let other: String = other.chars().filter(|c| !c.is_control()).take(20).collect();
            return Err(
                format!("is compressed by `{other}`; only zstd, lz4, bz2 and none are supported").into()
            );
        }
    };
    match read {
        Ok(count) if count as u64 == size => Ok(bytes),
        Ok(count) if (count as u64) < size => {
            Err(format!("is damaged: it contains {count} bytes but claims {size}").into())
        }
        Ok(_) => Err(format!("is damaged: it contains more than the claimed {size} bytes").into()),
        Err(error) => Err(format!("is damaged: {}", error.to_string().replace('\n', " ")).into()),
    }
}

/// The bytes of a message, decompressed if it is individually compressed.
///
/// # Errors
/// If decompression fails, worded to follow the name of the message.
pub(super) fn plain(bytes: &[u8], encoding: Encoding) -> Result<Vec<u8>, Reason> {
    // No CDR message starts with these bytes.
    let is_packed = encoding == Encoding::Cdr && bytes.starts_with(ZSTD);
    if is_packed { unpacked_alone(bytes) } else { Ok(bytes.to_vec()) }
}

/// Decompresses a message that is individually compressed by Zstandard.
///
/// # Errors
/// If decompression fails, worded to follow the name of the message.
pub(super) fn unpacked_alone(packed: &[u8]) -> Result<Vec<u8>, Reason> {
    let mut bytes = Vec::new();
    let from = StreamingDecoder::new(packed).map_err(|error| format!("is not zstd: {error}"))?;
    let read = from.take(MAX_RECORD + 1).read_to_end(&mut bytes);
    read.map_err(|error| format!("is damaged: {}", error.to_string().replace('\n', " ")))?;
    if bytes.len() as u64 > MAX_RECORD {
        return Err(
            format!("contains more than {MAX_RECORD} bytes, the most that is decompressed at once").into()
        );
    }
    Ok(bytes)
}
