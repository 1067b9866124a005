//! The file of a block: its maps, packed row by row so that rows of blocks are joined without holding them.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::bufread::ZlibDecoder;
use flate2::write::ZlibEncoder;
use mrfgs::Error;
use mrfgs::image::write::Growing;
use mrfgs::image::{Plane, Rect};
use mrfgs::maps::{Maps, RightMap};
use mrfgs::prior::PriorUse;
use serde::{Deserialize, Serialize};

/// The first line of a file, with the version of its format.
const FIRST: &str = "mrfgs block 1\n";
/// Longest line that describes a block, in bytes.
const LONGEST: u64 = 1 << 16;

/// The record of a matched block: where it lies, what it ran on, and how long it took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct BlockRecord {
    /// The identity of the match that it belongs to.
    pub(super) of: String,
    /// First column and row, width and height in the left view.
    part: [usize; 4],
    /// Whether the maps of the right view follow.
    right: bool,
    pub(crate) ran_on: String,
    pub(crate) driver: Option<String>,
    pub(crate) note: Option<String>,
    pub(crate) tiles: usize,
    pub(crate) iterations: u32,
    pub(crate) seconds: f64,
    pub(crate) prior: Option<PriorUse>,
}

impl BlockRecord {
    /// The record of the block `part` of the match `of`.
    pub(super) fn new(
        of: &str,
        part: &Rect,
        matched: &mrfgs::Matched,
        note: Option<String>,
        seconds: f64,
    ) -> Self {
        Self {
            of: of.to_owned(),
            part: numbers(part),
            right: matched.maps.right.is_some(),
            ran_on: matched.ran_on.clone(),
            driver: matched.driver.clone(),
            note,
            tiles: matched.tiles.count(),
            iterations: matched.iterations,
            seconds,
            prior: matched.prior,
        }
    }

    /// Whether it is of the match `of` and the block `part`.
    pub(super) fn is_of(&self, of: &str, part: &Rect) -> bool {
        self.of == of && self.part == numbers(part)
    }
}

fn numbers(part: &Rect) -> [usize; 4] {
    [part.x.start, part.y.start, part.x.len(), part.y.len()]
}

/// Writes a block, completely or not at all.
pub(super) fn write(path: &Path, record: &BlockRecord, maps: &Maps) -> mrfgs::Result<()> {
    let io = |e| Error::write(path, e);
    let mut file = Growing::new(path)?;
    let line = serde_json::to_string(record).map_err(|e| Error::write(path, e.to_string()))?;
    file.write_all(format!("{FIRST}{line}\n").as_bytes()).map_err(io)?;
    let mut packed = ZlibEncoder::new(io::BufWriter::with_capacity(1 << 16, &mut file), Compression::fast());
    let mut row = Vec::new();
    for y in 0..maps.disparity.height() {
        row.clear();
        differences(maps.disparity.row(y).iter().copied(), &mut row);
        let raw = maps.raw.row(y).iter().zip(maps.disparity.row(y));
        row.extend(raw.flat_map(|(raw, final_one)| raw.wrapping_sub(*final_one).to_le_bytes()));
        row.extend_from_slice(maps.confidence.row(y));
        row.extend_from_slice(maps.validity.row(y));
        if let Some(right) = &maps.right {
            differences(right.disparity.row(y).iter().copied(), &mut row);
            row.extend_from_slice(right.validity.row(y));
        }
        packed.write_all(&row).map_err(io)?;
    }
    packed.finish().and_then(|mut rest| rest.flush()).map_err(io)?;
    file.finish()
}

/// Appends the differences between neighbouring values, which pack better.
fn differences(values: impl Iterator<Item = i32>, to: &mut Vec<u8>) {
    let mut last = 0;
    for value in values {
        to.extend(value.wrapping_sub(last).to_le_bytes());
        last = value;
    }
}

/// The inverse of [`differences`].
fn sums(bytes: &[u8]) -> impl Iterator<Item = i32> {
    words(bytes).scan(0_i32, |last, difference| {
        *last = last.wrapping_add(difference);
        Some(*last)
    })
}

fn words(bytes: &[u8]) -> impl Iterator<Item = i32> {
    bytes.as_chunks::<4>().0.iter().map(|word| i32::from_le_bytes(*word))
}

/// The rows of a stored block, from the top.
pub(super) struct Rows {
    path: PathBuf,
    pub(super) record: BlockRecord,
    packed: ZlibDecoder<BufReader<File>>,
    left: usize,
}

impl Rows {
    /// Opens a block; `None` if there is no such file.
    pub(super) fn open(path: &Path) -> mrfgs::Result<Option<Self>> {
        let file = match File::open(path) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            file => file.map_err(|e| Error::read(path, e.to_string()))?,
        };
        let mut file = BufReader::with_capacity(1 << 16, file);
        let mut head = Vec::new();
        let mut line = |head: &mut Vec<u8>| {
            head.clear();
            (&mut file).take(LONGEST).read_until(b'\n', head).map_err(|e| Error::read(path, e.to_string()))
        };
        line(&mut head)?;
        if head != FIRST.as_bytes() {
            return Err(Error::read(path, "is no block of this version; remove it, and run again"));
        }
        line(&mut head)?;
        let record = serde_json::from_slice::<BlockRecord>(&head).map_err(|_| damaged(path))?;
        let left = record.part[3];
        Ok(Some(Self { path: path.to_owned(), packed: ZlibDecoder::new(file), record, left }))
    }

    /// The next `count` rows; fewer at the end of the block.
    pub(super) fn next(&mut self, count: usize) -> mrfgs::Result<Maps> {
        let (width, count) = (self.record.part[2], count.min(self.left));
        let error = |_| damaged(&self.path);
        let mut row = vec![0; width * if self.record.right { 15 } else { 10 }];
        let [mut disparity, mut raw, mut right] = [const { Vec::<i32>::new() }; 3];
        let [mut confidence, mut validity, mut right_validity] = [const { Vec::<u8>::new() }; 3];
        for _ in 0..count {
            self.packed.read_exact(&mut row).map_err(error)?;
            let (of_disparity, rest) = row.split_at(4 * width);
            let (of_raw, rest) = rest.split_at(4 * width);
            let start = disparity.len();
            disparity.extend(sums(of_disparity));
            raw.extend(
                words(of_raw).zip(&disparity[start..]).map(|(more, final_one)| more.wrapping_add(*final_one)),
            );
            let (of_confidence, rest) = rest.split_at(width);
            confidence.extend_from_slice(of_confidence);
            validity.extend_from_slice(&rest[..width]);
            if self.record.right {
                let (of_right, rest) = rest[width..].split_at(4 * width);
                right.extend(sums(of_right));
                right_validity.extend_from_slice(rest);
            }
        }
        self.left -= count;
        if self.left == 0 {
            // Reading past the end checks the sum of all bytes.
            match self.packed.read(&mut [0]) {
                Ok(0) => {}
                _ => return Err(damaged(&self.path)),
            }
        }
        let bytes = |values| Plane::new(width, count, values);
        let right = self.record.right.then(|| RightMap {
            disparity: Plane::new(width, count, right),
            validity: bytes(right_validity),
        });
        Ok(Maps {
            disparity: Plane::new(width, count, disparity),
            raw: Plane::new(width, count, raw),
            confidence: bytes(confidence),
            validity: bytes(validity),
            right,
        })
    }
}

fn damaged(path: &Path) -> Error {
    Error::read(path, "the block is damaged; remove it, and run again")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Maps of `size` that hold all kinds of values.
    pub(crate) fn maps((width, height): (usize, usize), right: bool) -> Maps {
        let value = |x: usize, y: usize| (x * 977 + y * 7919) as i32;
        let disparity =
            Plane::from_fn(
                width,
                height,
                |x, y| if (x + y) % 7 == 0 { i32::MIN } else { value(x, y) - 9000 },
            );
        let bytes = Plane::from_fn(width, height, |x, y| (value(x, y) % 256) as u8);
        Maps {
            raw: disparity.map(|d| d.wrapping_mul(3)),
            confidence: bytes.clone(),
            validity: bytes.map(|v| 255 - v),
            right: right.then(|| RightMap { disparity: disparity.map(|d| !d), validity: bytes.clone() }),
            disparity,
        }
    }

    fn record(part: &Rect, right: bool) -> BlockRecord {
        BlockRecord {
            of: "a match".into(),
            part: numbers(part),
            right,
            ran_on: "the CPU path".into(),
            driver: None,
            note: Some("a note".into()),
            tiles: 3,
            iterations: 4,
            seconds: 0.5,
            prior: None,
        }
    }

    #[test]
    fn blocks_survive_a_round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("block");
        assert!(Rows::open(&path).unwrap().is_none());
        for (size, right) in [((1, 1), false), ((37, 29), true), ((300, 5), false)] {
            let (maps, part) = (maps(size, right), Rect { x: 5..5 + size.0, y: 64..64 + size.1 });
            let record = record(&part, right);
            write(&path, &record, &maps).unwrap();
            for step in [1, 4, 100] {
                let mut rows = Rows::open(&path).unwrap().unwrap();
                assert_eq!(rows.record, record);
                assert!(rows.record.is_of("a match", &part) && !rows.record.is_of("another", &part));
                for y in (0..size.1).step_by(step) {
                    let expected = maps.crop(&Rect { x: 0..size.0, y: y..(y + step).min(size.1) });
                    assert_eq!(rows.next(step).unwrap(), expected);
                }
            }
        }
    }

    #[test]
    fn damaged_blocks_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("block");
        let part = Rect { x: 0..40, y: 0..30 };
        write(&path, &record(&part, false), &maps((40, 30), false)).unwrap();
        let whole = std::fs::read(&path).unwrap();
        let read = || Rows::open(&path).and_then(|rows| rows.unwrap().next(30)).map_err(|e| e.to_string());
        read().unwrap();
        let header = whole.iter().enumerate().filter(|(_, byte)| **byte == b'\n').nth(1).unwrap().0;
        for cut in [0, 5, 20, header, header + 9, whole.len() - 1] {
            std::fs::write(&path, &whole[..cut]).unwrap();
            let said = read().unwrap_err();
            assert!(said.contains("block") && said.contains("remove it, and run again"), "{cut}: {said}");
        }
        for at in [3, FIRST.len() + 2, header + 30, whole.len() - 2] {
            let mut changed = whole.clone();
            changed[at] ^= 0x15;
            std::fs::write(&path, &changed).unwrap();
            assert!(read().is_err(), "{at}");
        }
    }
}
