//! Files whose records state their lengths, perhaps wrongly.

use std::fs;
use std::io::{BufReader, Read};
use std::path::PathBuf;

use mrfgs::error::Reason;
use mrfgs::{Error, Result};

use super::place::Place;

/// The largest record that is read at once, in bytes.
pub(super) const MAX_RECORD: u64 = 1 << 30;

/// A file with the reading position.
pub(super) struct File {
    path: PathBuf,
    from: BufReader<fs::File>,
    at: u64,
    len: u64,
}

impl File {
    pub(super) fn open(place: &Place) -> Result<Self> {
        let path = &place.path;
        let opened = fs::File::open(place.file()).map_err(|e| match e.kind() {
            std::io::ErrorKind::NotFound => {
                Error::read(path, Reason::from_io(e, "there is no such file; check the name"))
            }
            _ => Error::read(path, e),
        })?;
        let len = opened.metadata().map_err(|e| Error::read(path, e))?.len();
        Ok(Self { path: path.to_owned(), from: BufReader::with_capacity(1 << 16, opened), at: 0, len })
    }

    pub(super) fn at(&self) -> u64 {
        self.at
    }

    pub(super) fn len(&self) -> u64 {
        self.len
    }

    pub(super) fn left(&self) -> u64 {
        self.len - self.at
    }

    pub(super) fn error(&self, reason: impl Into<Reason>) -> Error {
        Error::read(&self.path, reason.into())
    }

    /// Reads the next `count` bytes.
    pub(super) fn take(&mut self, count: u64) -> Result<Vec<u8>> {
        self.check(count)?;
        if count > MAX_RECORD {
            return Err(self.error(format!(
                "contains a record of {count} bytes at byte {}, but at most {MAX_RECORD} are read at once",
                self.at
            )));
        }
        let mut bytes = Vec::new();
        let room = bytes.try_reserve_exact(count as usize);
        room.map_err(|_| self.error(format!("there is not enough memory for a record of {count} bytes")))?;
        let read =
            self.from.by_ref().take(count).read_to_end(&mut bytes).map_err(|e| Error::read(&self.path, e))?;
        self.at += read as u64;
        if read as u64 != count {
            return Err(self.error("was truncated while it was read"));
        }
        Ok(bytes)
    }

    pub(super) fn skip(&mut self, count: u64) -> Result<()> {
        self.check(count)?;
        self.from.seek_relative(count as i64).map_err(|e| Error::read(&self.path, e))?;
        self.at += count;
        Ok(())
    }

    pub(super) fn seek(&mut self, to: u64) -> Result<()> {
        let to = to.min(self.len);
        // Keeps the buffer for short distances.
        let way = to.cast_signed() - self.at.cast_signed();
        self.from.seek_relative(way).map_err(|e| Error::read(&self.path, e))?;
        self.at = to;
        Ok(())
    }

    /// Refuses to read beyond the end.
    fn check(&self, count: u64) -> Result<()> {
        if count <= self.left() {
            return Ok(());
        }
        Err(self.error(format!(
            "is cut off: at byte {} of {} a record of {count} bytes starts; complete messages are used",
            self.at, self.len
        )))
    }
}
