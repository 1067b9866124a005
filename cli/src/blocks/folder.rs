//! The folder of a match in blocks. Several runs may share it: each block is matched by one of them.

use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use flate2::Crc;
use mrfgs::error::Reason;
use mrfgs::image::{Rect, write};
use mrfgs::maps::Maps;
use mrfgs::options::DisparityRange;
use mrfgs::region::Blocks;
use mrfgs::{Conditioning, Error, Matched};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::blocks::stored::{self, BlockRecord, Rows};
use crate::failure::Result;
use crate::outputs::{Claim, files};
use crate::text::fnv1a;

/// The file that describes the match.
const MATCH: &str = "match.json";
/// Number of places where a large input is read to recognize it, and bytes of each.
const PLACES: u64 = 16;
const PLACE: u64 = 1 << 16;

/// Range and corrections of a pair, which all of its blocks share.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Known {
    /// The disparities to search, in pixels.
    min: i32,
    max: i32,
    /// How far the right view is moved up, in 1/256 px.
    offset: i32,
    /// Standard deviations by which the views are smoothed, in pixels: as text, which keeps every bit.
    smoothing: [String; 2],
}

impl Known {
    pub(crate) fn new(range: DisparityRange, corrections: Conditioning) -> Self {
        let (DisparityRange { min, max }, Conditioning { offset, smoothing, .. }) = (range, corrections);
        Self { min, max, offset, smoothing: smoothing.map(|sigma| sigma.to_string()) }
    }

    pub(crate) fn range(&self) -> mrfgs::Result<DisparityRange> {
        DisparityRange::new(self.min, self.max)
    }

    /// The corrections; none that is no number.
    pub(crate) fn corrections(&self) -> Conditioning {
        let mut known = Conditioning::default();
        known.offset = self.offset;
        known.smoothing = self.smoothing.each_ref().map(|sigma| sigma.parse().unwrap_or_default());
        known
    }
}

/// Recognizes an input file, wherever it is.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Fingerprint {
    bytes: u64,
    /// CRC-32 of the whole file, or of some places in a large one.
    crc: u32,
}

impl Fingerprint {
    pub(crate) fn of(path: &Path) -> Result<Self> {
        if path.metadata().is_ok_and(|about| !about.is_file()) {
            return Err(
                Error::read(path, "is no file, so it cannot be matched in blocks; save it as one").into()
            );
        }
        let read = || -> io::Result<Self> {
            let mut file = File::open(path)?;
            let (bytes, mut crc) = (file.metadata()?.len(), Crc::new());
            let mut buffer = Vec::new();
            let last = bytes.saturating_sub(PLACE);
            let places = if bytes > PLACES * PLACE { PLACES } else { 1 };
            for place in 0..places {
                file.seek(SeekFrom::Start(last * place / (places - 1).max(1)))?;
                buffer.clear();
                let most = if places == 1 { u64::MAX } else { PLACE };
                (&mut file).take(most).read_to_end(&mut buffer)?;
                crc.update(&buffer);
            }
            Ok(Self { bytes, crc: crc.sum() })
        };
        Ok(read().map_err(|e| Error::read(path, e.to_string()))?)
    }
}

/// The contents of `match.json`.
#[derive(Serialize, Deserialize)]
struct Manifest {
    /// The images, flags and method that determine the maps.
    request: Value,
    known: Known,
    /// Width and height of the maps.
    size: [usize; 2],
    /// Number of blocks.
    blocks: usize,
}

/// A folder for the blocks of a match.
pub(crate) struct BlockFolder {
    path: PathBuf,
    /// The images, flags and method that determine the maps.
    request: Value,
    /// Range and corrections that an earlier run has found; `None` for the first run.
    known: Option<Known>,
}

impl BlockFolder {
    /// The folder `path` for a match by `request`. It may not exist.
    ///
    /// # Errors
    /// If it belongs to another match, or holds something else.
    pub(crate) fn open(path: &Path, request: &impl Serialize) -> Result<Self> {
        files::folder_place(path)?;
        let told = |e: serde_json::Error| Error::write(path, e.to_string());
        let request = serde_json::to_value(request).map_err(told)?;
        // Reading rounds numbers.
        let as_read: Value = serde_json::from_str(&files::json_text(path, &request)?).map_err(told)?;
        let named = path.join(MATCH);
        let known = match fs::read(&named) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                // Another run may be beginning.
                let is_ours = |name: &str| name.starts_with('.');
                let is_foreign = |entry: fs::DirEntry| !is_ours(&entry.file_name().to_string_lossy());
                if fs::read_dir(path)
                    .is_ok_and(|mut entries| entries.any(|entry| entry.is_ok_and(is_foreign)))
                {
                    let reason = Reason::of_request("the folder holds other files; give a new one");
                    return Err(Error::write(path, reason).into());
                }
                None
            }
            bytes => {
                let bytes = bytes.map_err(|e| Error::read(&named, e.to_string()))?;
                let manifest: Manifest = serde_json::from_slice(&bytes).map_err(|_| {
                    Error::read(&named, "does not describe a match; remove the folder, or give another one")
                })?;
                if let Some(key) = difference(&manifest.request, &as_read) {
                    let reason = format!(
                        "the folder holds blocks of another match, whose {key} differs; give another folder, or remove this one"
                    );
                    return Err(Error::write(path, Reason::of_request(reason)).into());
                }
                Some(manifest.known)
            }
        };
        Ok(Self { path: path.to_owned(), request, known })
    }

    /// Range and corrections that an earlier run has found; `None` for the first run.
    pub(crate) fn known(&self) -> Option<Known> {
        self.known.clone()
    }

    /// Describes the match in the folder, which then takes its `blocks`, and is created if it does not exist.
    pub(crate) fn begin(self, known: Known, blocks: &Blocks) -> Result<BlockFiles> {
        let (width, height) = blocks.size();
        let parts: Vec<Rect> = blocks.list().iter().map(|block| block.part().clone()).collect();
        let is_new = self.known.is_none();
        let manifest = Manifest { request: self.request, known, size: [width, height], blocks: parts.len() };
        let path = self.path.join(MATCH);
        let text = files::json_text(&path, &manifest)?;
        if is_new {
            files::create_folder(&self.path).map_err(|e| Error::write(&self.path, e))?;
            write::save(&path, text.as_bytes())?;
        }
        Ok(BlockFiles {
            folder: self.path,
            of: format!("{:016x}", fnv1a(&text)),
            size: (width, height),
            parts,
        })
    }
}

/// The first key whose value differs.
fn difference(one: &Value, other: &Value) -> Option<String> {
    let (Value::Object(one), Value::Object(other)) = (one, other) else { return Some("request".into()) };
    let keys = one.keys().chain(other.keys());
    keys.into_iter().find(|key| one.get(*key) != other.get(*key)).cloned()
}

/// The files of the blocks of a match.
pub(crate) struct BlockFiles {
    folder: PathBuf,
    /// The identity of the match.
    of: String,
    size: (usize, usize),
    parts: Vec<Rect>,
}

impl BlockFiles {
    /// (width, height) of the maps.
    pub(crate) fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Number of blocks.
    pub(crate) fn count(&self) -> usize {
        self.parts.len()
    }

    /// The parts of the view.
    pub(super) fn parts(&self) -> &[Rect] {
        &self.parts
    }

    fn name(index: usize) -> String {
        format!("block-{:05}", index + 1)
    }

    /// The path of block `index`.
    fn path(&self, index: usize) -> PathBuf {
        self.folder.join(Self::name(index))
    }

    /// Whether block `index` is complete.
    ///
    /// # Errors
    /// If its file is damaged, or belongs to another match.
    pub(crate) fn is_complete(&self, index: usize) -> mrfgs::Result<bool> {
        Ok(self.rows(index)?.is_some())
    }

    /// Number of complete blocks.
    ///
    /// # Errors
    /// The errors of [`Self::is_complete`].
    pub(crate) fn complete(&self) -> mrfgs::Result<usize> {
        (0..self.count()).try_fold(0, |count, block| Ok(count + usize::from(self.is_complete(block)?)))
    }

    /// The record of block `index`, which is complete.
    pub(crate) fn record(&self, index: usize) -> mrfgs::Result<BlockRecord> {
        Ok(self.complete_rows(index)?.record)
    }

    /// The rows of block `index`; `None` if it is missing.
    fn rows(&self, index: usize) -> mrfgs::Result<Option<Rows>> {
        let path = self.path(index);
        let rows = Rows::open(&path)?;
        if rows.as_ref().is_some_and(|rows| !rows.record.is_of(&self.of, &self.parts[index])) {
            return Err(Error::read(path, "is a block of another match; remove it, and run again"));
        }
        Ok(rows)
    }

    /// The rows of block `index`, which was complete.
    pub(super) fn complete_rows(&self, index: usize) -> mrfgs::Result<Rows> {
        let missing = || Error::read(self.path(index), "the block is gone; run again");
        self.rows(index)?.ok_or_else(missing)
    }

    /// Claims block `index`; `None` if another run holds it.
    pub(crate) fn claim(&self, index: usize) -> mrfgs::Result<Option<Claim>> {
        Claim::new(&self.folder, Self::name(index))
    }

    /// Claims the outputs, so that one of several runs that end together joins them; `None` if another run does.
    pub(crate) fn claim_outputs(&self) -> mrfgs::Result<Option<Claim>> {
        Claim::new(&self.folder, "outputs")
    }

    /// Stores block `index`.
    pub(crate) fn store(
        &self,
        index: usize,
        maps: &Maps,
        matched: &Matched,
        note: Option<String>,
        seconds: f64,
    ) -> mrfgs::Result<()> {
        let record = BlockRecord::new(&self.of, &self.parts[index], matched, note, seconds);
        stored::write(&self.path(index), &record, maps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_folder_belongs_to_one_match() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("blocks");
        let range = DisparityRange::new(0, 31).unwrap();
        let request = |name: &str| json!({ "method": name, "share": 0.1 + 0.2, "files": 3 });
        let blocks = Blocks::new((300, 200), range, &mrfgs::Method::default()).unwrap();
        let mut corrections = Conditioning::default();
        (corrections.offset, corrections.smoothing) = (-77, [0.1 + 0.2, 1.0 / 3.0]);
        let known = Known::new(range, corrections);
        assert_eq!(known.corrections(), corrections);
        let folder = BlockFolder::open(&path, &request("a")).unwrap();
        assert_eq!(folder.known(), None);
        let begun = folder.begin(known.clone(), &blocks).unwrap();
        let again = BlockFolder::open(&path, &request("a")).unwrap();
        assert_eq!(again.known(), Some(known.clone()));
        assert_eq!(again.begin(known, &blocks).unwrap().of, begun.of);
        let said = BlockFolder::open(&path, &request("b")).err().unwrap().to_string();
        assert!(said.contains("another match, whose method differs"), "{said}");
        fs::write(path.join(MATCH), "{}").unwrap();
        assert!(BlockFolder::open(&path, &request("a")).is_err());
        fs::remove_file(path.join(MATCH)).unwrap();
        fs::write(path.join("mine.txt"), "").unwrap();
        let said = BlockFolder::open(&path, &request("a")).err().unwrap().to_string();
        assert!(said.contains("holds other files"), "{said}");
    }

    #[test]
    fn files_are_recognized() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let of = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            Fingerprint::of(&path).unwrap()
        };
        let small = of(b"123456789");
        // The published check value of CRC-32.
        assert_eq!(small, Fingerprint { bytes: 9, crc: 0xcbf4_3926 });
        assert_ne!(small, of(b"123456780"));
        let mut large = vec![7; 3 << 20];
        let before = of(&large);
        *large.last_mut().unwrap() = 8;
        assert_ne!(of(&large), before);
        large[0] = 8;
        *large.last_mut().unwrap() = 7;
        assert_ne!(of(&large), before);
    }
}
