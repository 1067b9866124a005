//! Where the bytes of a recording are: in its file, or for one that is packed as a whole in a copy of it.

use std::fs;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mrfgs::error::Reason;
use mrfgs::{Error, Result};
use ruzstd::decoding::StreamingDecoder;
use tempfile::{NamedTempFile, TempPath};

/// How what is packed by Zstandard begins.
pub(super) const ZSTD: &[u8] = &[0x28, 0xb5, 0x2f, 0xfd];
/// A file that claims to hold more than so many times its size would only fill the disk.
const MOST_TIMES: u64 = 10_000;

/// A file of a recording.
#[derive(Clone, Debug)]
pub(super) struct Place {
    /// By which the user knows it.
    pub(super) path: PathBuf,
    /// Its copy, which goes with the last one who reads it.
    unpacked: Option<Arc<TempPath>>,
}

impl Place {
    /// A file as it is.
    pub(super) fn plain(path: &Path) -> Self {
        Self { path: path.to_owned(), unpacked: None }
    }

    /// A file, unpacked where it is packed as a whole.
    ///
    /// # Errors
    /// Where it cannot be read or unpacked.
    pub(super) fn of(path: &Path) -> Result<Self> {
        let mut start = Vec::new();
        let read = fs::File::open(path).and_then(|file| file.take(ZSTD.len() as u64).read_to_end(&mut start));
        let plain = Self::plain(path);
        // Who reads it says why it cannot be read.
        if read.is_err() || start != ZSTD {
            return Ok(plain);
        }
        let unpacked = unpacked(path).map_err(|reason| Error::read(path, reason))?;
        Ok(Self { unpacked: Some(Arc::new(unpacked)), ..plain })
    }

    /// Where its bytes are read.
    pub(super) fn file(&self) -> &Path {
        self.unpacked.as_ref().map_or(&self.path, |unpacked| unpacked)
    }
}

/// A copy of a packed file, unpacked.
fn unpacked(path: &Path) -> std::result::Result<TempPath, Reason> {
    let opened = fs::File::open(path)?;
    let most = opened.metadata()?.len().saturating_mul(MOST_TIMES);
    let written = |e: io::Error| {
        let folder = std::env::temp_dir();
        Reason::from(format!(
            "cannot be unpacked to {}: {e}; set TMPDIR to a folder with more room, or unpack it with `zstd -d`",
            folder.display()
        ))
    };
    let mut to = NamedTempFile::with_prefix(".mrfgs-").map_err(written)?;
    let mut from = BufReader::new(opened);
    let (mut part, mut all) = (vec![0; 1 << 16], 0);
    // Its parts may have been packed one by one.
    while !from.fill_buf()?.is_empty() {
        let mut decoder = StreamingDecoder::new(&mut from).map_err(|e| damaged(&e))?;
        loop {
            let count = decoder.read(&mut part).map_err(|e| damaged(&e))?;
            all += count as u64;
            if all > most {
                return Err(format!(
                    "claims more than {MOST_TIMES} times its size; unpack it with `zstd -d`"
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
            return Err(damaged(&"its checksum does not agree"));
        }
    }
    Ok(to.into_temp_path())
}

fn damaged(e: &dyn std::fmt::Display) -> Reason {
    format!("is damaged, or cut off: {}; get it again", e.to_string().replace('\n', " ")).into()
}
