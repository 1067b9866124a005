//! Files on the disk that are read and written at any place, by several threads at once.

use std::fs::{self, File};
use std::io::{self, Seek};
use std::path::Path;

use crate::error::{Purpose, ReadError};
use crate::memory;

/// Fewer bytes than this are read without asking whether there is memory for them.
const SMALL: u64 = 1 << 20;

/// An open file.
#[derive(Debug)]
pub(super) struct Disk {
    file: File,
    length: u64,
}

impl Disk {
    /// Opens `path` if it is a file with an end, which can be read twice: no folder, and no pipe.
    ///
    /// # Errors
    /// That of the system.
    pub(super) fn open(path: &Path) -> io::Result<Option<Self>> {
        // Opening a pipe would take it from its writer.
        if !fs::metadata(path)?.is_file() {
            return Ok(None);
        }
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        Ok(Some(Self { file, length }))
    }

    /// The file itself, to be read from its start.
    ///
    /// # Errors
    /// That of the system.
    pub(super) fn into_file(mut self) -> io::Result<File> {
        // On some systems, reading at a place moves the position too.
        self.file.rewind()?;
        Ok(self.file)
    }

    /// A file that is to be written.
    pub(super) fn empty(file: File) -> Self {
        Self { file, length: 0 }
    }

    /// Number of bytes: those when it was opened, or written since.
    pub(super) fn len(&self) -> u64 {
        self.length
    }

    /// `count` bytes from `start`.
    ///
    /// # Errors
    /// That of the system, also when the file is shorter by now; or about memory.
    pub(super) fn read(&self, start: u64, count: u64) -> Result<Vec<u8>, ReadError> {
        if count > SMALL {
            memory::check(count, Purpose::Image)?;
        }
        let mut bytes = memory::filled(usize::try_from(count).unwrap_or(usize::MAX), 0)?;
        self.fill(&mut bytes, start)?;
        Ok(bytes)
    }

    /// Reads as many bytes from `start` as `bytes` holds.
    ///
    /// # Errors
    /// That of the system, also when the file is shorter.
    #[cfg(not(windows))]
    pub(super) fn fill(&self, bytes: &mut [u8], start: u64) -> io::Result<()> {
        std::os::unix::fs::FileExt::read_exact_at(&self.file, bytes, start)
    }

    #[cfg(windows)]
    pub(super) fn fill(&self, mut bytes: &mut [u8], mut start: u64) -> io::Result<()> {
        while !bytes.is_empty() {
            let count = std::os::windows::fs::FileExt::seek_read(&self.file, bytes, start)?;
            if count == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            (bytes, start) = (&mut bytes[count..], start + count as u64);
        }
        Ok(())
    }

    /// Writes `bytes` from `start` on.
    ///
    /// # Errors
    /// That of the system, such as a full disk.
    pub(super) fn write(&mut self, bytes: &[u8], start: u64) -> io::Result<()> {
        self.length = self.length.max(start + bytes.len() as u64);
        self.write_all(bytes, start)
    }

    #[cfg(not(windows))]
    fn write_all(&self, bytes: &[u8], start: u64) -> io::Result<()> {
        std::os::unix::fs::FileExt::write_all_at(&self.file, bytes, start)
    }

    #[cfg(windows)]
    fn write_all(&self, mut bytes: &[u8], mut start: u64) -> io::Result<()> {
        while !bytes.is_empty() {
            let count = std::os::windows::fs::FileExt::seek_write(&self.file, bytes, start)?;
            if count == 0 {
                return Err(io::ErrorKind::WriteZero.into());
            }
            (bytes, start) = (&bytes[count..], start + count as u64);
        }
        Ok(())
    }
}
