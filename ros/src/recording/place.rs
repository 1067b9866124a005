//! The location of a recording's bytes: its file, or a decompressed copy of it.

use std::fs;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mrfgs::error::Reason;
use mrfgs::{Error, Result};
use ruzstd::decoding::StreamingDecoder;
use tempfile::{NamedTempFile, TempPath};

/// The first bytes of Zstandard data.
pub(super) const ZSTD: &[u8] = &[0x28, 0xb5, 0x2f, 0xfd];
/// Maximum compression ratio; a file that claims more would only fill the disk.
const MOST_TIMES: u64 = 10_000;

/// A file of a recording.
#[derive(Clone, Debug)]
pub(super) struct Place {
    /// The path for messages.
    pub(super) path: PathBuf,
    /// A decompressed copy, removed with its last user.
    unpacked: Option<Arc<TempPath>>,
}

impl Place {
    /// A file that is read directly.
    pub(super) fn plain(path: &Path) -> Self {
        Self { path: path.to_owned(), unpacked: None }
    }

    /// A file, decompressed if it is compressed as a whole.
    ///
    /// # Errors
    /// If it cannot be read or decompressed.
    pub(super) fn of(path: &Path) -> Result<Self> {
        let mut start = Vec::new();
        let read = fs::File::open(path).and_then(|file| file.take(ZSTD.len() as u64).read_to_end(&mut start));
        let plain = Self::plain(path);
        // Reading it later reports the error.
        if read.is_err() || start != ZSTD {
            return Ok(plain);
        }
        let unpacked = unpacked(path).map_err(|reason| Error::read(path, reason))?;
        Ok(Self { unpacked: Some(Arc::new(unpacked)), ..plain })
    }

    /// The path to read from.
    pub(super) fn file(&self) -> &Path {
        self.unpacked.as_ref().map_or(&self.path, |unpacked| unpacked)
    }
}

/// Decompresses a file to a temporary one.
fn unpacked(path: &Path) -> std::result::Result<TempPath, Reason> {
    let opened = fs::File::open(path)?;
    let most = opened.metadata()?.len().saturating_mul(MOST_TIMES);
    let written = |e: io::Error| {
        let folder = std::env::temp_dir();
        Reason::from(format!(
            "cannot be decompressed to {}: {e}; set TMPDIR to a folder with more space, or decompress it with `zstd -d`",
            folder.display()
        ))
    };
    let mut to = NamedTempFile::with_prefix(".mrfgs-").map_err(written)?;
    let mut from = BufReader::new(opened);
    let (mut part, mut all) = (vec![0; 1 << 16], 0);
    // The file may consist of several compressed frames.
    while !from.fill_buf()?.is_empty() {
        let mut decoder = StreamingDecoder::new(&mut from).map_err(|e| damaged(&e))?;
        loop {
            let count = decoder.read(&mut part).map_err(|e| damaged(&e))?;
            all += count as u64;
            if all > most {
                return Err(format!(
                    "expands to more than {MOST_TIMES} times its size; decompress it with `zstd -d`"
                )
                .into());
            }
            if count == 0 {
                break;
            }
            to.write_all(&part[..count]).map_err(written)?;
        }
        if let (Some(told), found) =
            (decoder.decoder.get_checksum_from_data(), decoder.decoder.get_calculated_checksum())
            && found != Some(told)
        {
            return Err(damaged(&"its checksum is wrong"));
        }
    }
    Ok(to.into_temp_path())
}

fn damaged(e: &dyn std::fmt::Display) -> Reason {
    format!("is damaged or cut off: {}; get it again", e.to_string().replace('\n', " ")).into()
}
