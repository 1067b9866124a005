//! The packed parts of recordings.

use std::io::Read;

use bzip2::read::BzDecoder;
use lz4_flex::frame::FrameDecoder;
use mrfgs::error::Reason;
use ruzstd::decoding::StreamingDecoder;

use super::file::MAX_RECORD;
use super::message::Message;
use super::place::ZSTD;
use crate::messages::Encoding;

/// The records of a chunk, which are taken one by one.
#[derive(Default)]
pub(super) struct Chunk {
    records: Vec<u8>,
    /// How far they have been taken.
    at: usize,
    /// Where the chunk begins in the file.
    start: u64,
}

impl Chunk {
    pub(super) fn new(records: Vec<u8>, start: u64) -> Self {
        Self { records, at: 0, start }
    }

    /// The next message. `take` takes the record at a byte of the chunk, and says where the next one begins.
    ///
    /// # Errors
    /// Those of `take`, in words that go after the name of the file.
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

/// What is in `packed`, which claims to hold `size` bytes and is packed by the method of this name.
///
/// # Errors
/// Where it is not so, in words that go after the name of the file.
pub(super) fn unpacked(packed: &[u8], method: &str, size: u64) -> Result<Vec<u8>, Reason> {
    if size > MAX_RECORD {
        return Err(format!("claims {size} bytes, and at most {MAX_RECORD} are unpacked at once").into());
    }
    let mut bytes = Vec::new();
    let read = match method {
        "" | "none" => packed.take(size + 1).read_to_end(&mut bytes),
        "lz4" => FrameDecoder::new(packed).take(size + 1).read_to_end(&mut bytes),
        "bz2" => BzDecoder::new(packed).take(size + 1).read_to_end(&mut bytes),
        "zstd" => match StreamingDecoder::new(packed) {
            Ok(from) => from.take(size + 1).read_to_end(&mut bytes),
            Err(error) => return Err(format!("is no zstd: {error}").into()),
        },
        other => {
            let other: String = other.chars().filter(|c| !c.is_control()).take(20).collect();
            return Err(format!("is packed by `{other}`; zstd, lz4, bz2 and none are read").into());
        }
    };
    match read {
        Ok(count) if count as u64 == size => Ok(bytes),
        Ok(count) if (count as u64) < size => {
            Err(format!("is damaged: it holds {count} bytes and claims {size}").into())
        }
        Ok(_) => Err(format!("is damaged: it holds more than the {size} bytes that it claims").into()),
        Err(error) => Err(format!("is damaged: {}", error.to_string().replace('\n', " ")).into()),
    }
}

/// The bytes of a message, unpacked where it is packed by itself.
///
/// # Errors
/// Where nothing can be unpacked, in words that go after the name of the message.
pub(super) fn plain(bytes: &[u8], encoding: Encoding) -> Result<Vec<u8>, Reason> {
    // None in CDR begins so.
    let is_packed = encoding == Encoding::Cdr && bytes.starts_with(ZSTD);
    if is_packed { unpacked_alone(bytes) } else { Ok(bytes.to_vec()) }
}

/// What is in a message of its own that is packed by Zstandard.
///
/// # Errors
/// Where nothing can be unpacked, in words that go after the name of the message.
pub(super) fn unpacked_alone(packed: &[u8]) -> Result<Vec<u8>, Reason> {
    let mut bytes = Vec::new();
    let from = StreamingDecoder::new(packed).map_err(|error| format!("is no zstd: {error}"))?;
    let read = from.take(MAX_RECORD + 1).read_to_end(&mut bytes);
    read.map_err(|error| format!("is damaged: {}", error.to_string().replace('\n', " ")))?;
    if bytes.len() as u64 > MAX_RECORD {
        return Err(format!(
            "holds more than {MAX_RECORD} bytes, which is the most that is unpacked at once"
        )
        .into());
    }
    Ok(bytes)
}
