//! Directories of TIFF files: tags and their values, as stored.

use std::borrow::Cow;
use std::collections::HashSet;

use tiff::tags::{ByteOrder, Tag};

use crate::error::ReadError;
use crate::image::bytes::Bytes;
use crate::image::file::{damaged, unsupported};

/// Most directories that are read, so that an endless file ends.
const MAX_DIRECTORIES: usize = 1 << 12;

/// A tag, and the position of its values.
#[derive(Clone, Copy, Debug)]
struct Entry {
    tag: u16,
    kind: u16,
    count: u64,
    /// Position in the file; the file may end before it.
    place: u64,
}

/// The type of the values of a tag, and their bytes.
type Values<'a> = (u16, Cow<'a, [u8]>);

/// The tags of one image in a file.
pub(super) struct Directory<'a> {
    file: Bytes<'a>,
    pub(super) order: ByteOrder,
    entries: Vec<Entry>,
    /// Position of the next directory; 0 after the last.
    next: u64,
}

impl<'a> Directory<'a> {
    /// The directory of the first image that is neither a reduced copy nor a mask of another one.
    ///
    /// # Errors
    /// A description of the damage, in one line.
    pub(super) fn parse(file: Bytes<'a>) -> Result<Self, ReadError> {
        let first = file.get(0, 4)?;
        let (order, big) = match first.as_deref().unwrap_or_default() {
            [b'I', b'I', kind, 0, ..] => (ByteOrder::LittleEndian, *kind == 43),
            [b'M', b'M', 0, kind, ..] => (ByteOrder::BigEndian, *kind == 43),
            _ => return Err(damaged("the TIFF file does not begin like one")),
        };
        let mut place = number_at(file, order, if big { 8 } else { 4 }, if big { 8 } else { 4 })?
            .ok_or_else(|| damaged("the TIFF file ends before its directory"))?;
        let first = Self::read(file, order, big, place)?;
        if first.is_image()? {
            return Ok(first);
        }
        let mut seen = HashSet::from([place]);
        place = first.next;
        while place != 0 && seen.insert(place) && seen.len() < MAX_DIRECTORIES {
            let Ok(other) = Self::read(file, order, big, place) else { break };
            if other.is_image()? {
                return Ok(other);
            }
            place = other.next;
        }
        if first.has(Tag::SubIfd) {
            return Err(
                "holds a reduced copy, and the image itself in a directory below; convert it to PNG".into()
            );
        }
        Ok(first)
    }

    fn read(file: Bytes<'a>, order: ByteOrder, big: bool, place: u64) -> Result<Self, ReadError> {
        // Sizes of the number of entries, of an entry, and of counts and positions.
        let (head, size, wide) = if big { (8, 20_u64, 8) } else { (2, 12, 4) };
        let ends = || damaged("the TIFF file ends within its directory");
        let count = number_at(file, order, place, head as usize)?.ok_or_else(ends)?;
        if count > file.len() / size {
            return Err(damaged(format!("the TIFF directory claims {count} tags in {} bytes", file.len())));
        }
        let start = place + head;
        let table = file.get(start, count * size)?.ok_or_else(ends)?;
        let mut entries = Vec::new();
        for (at, entry) in (start..).step_by(size as usize).zip(table.chunks_exact(size as usize)) {
            let field = |offset: usize, length: usize| number(order, &entry[offset..offset + length]);
            let (tag, kind, count) = (field(0, 2) as u16, field(2, 2) as u16, field(4, wide));
            let fits =
                (size_of_kind(kind) as u64).checked_mul(count).is_some_and(|bytes| bytes <= wide as u64);
            let place = if fits { at + 4 + wide as u64 } else { field(4 + wide, wide) };
            entries.push(Entry { tag, kind, count, place });
        }
        let next = number_at(file, order, start + count * size, wide)?.ok_or_else(ends)?;
        Ok(Self { file, order, entries, next })
    }

    /// Whether the directory is of a full-size image.
    fn is_image(&self) -> Result<bool, ReadError> {
        // Bit 0 marks a reduced copy, bit 2 a mask. The older tag has 2 for a reduced copy.
        Ok(self.first(Tag::NewSubfileType, 0)? & 5 == 0 && self.first(Tag::SubfileType, 1)? != 2)
    }

    /// Whether the directory has the tag.
    pub(super) fn has(&self, tag: Tag) -> bool {
        self.entries.iter().any(|entry| entry.tag == tag.to_u16())
    }

    /// The values of a tag as stored, with their type.
    pub(super) fn values(&self, tag: Tag) -> Result<Option<Values<'a>>, ReadError> {
        let Some(entry) = self.entries.iter().find(|entry| entry.tag == tag.to_u16()) else {
            return Ok(None);
        };
        let bytes = entry.count.checked_mul(size_of_kind(entry.kind) as u64);
        let values = bytes.map(|bytes| self.file.get(entry.place, bytes)).transpose()?.flatten();
        match values {
            Some(values) => Ok(Some((entry.kind, values))),
            None => Err(damaged(format!(
                "the TIFF directory claims {} values in {} bytes",
                entry.count,
                self.file.len()
            ))),
        }
    }

    /// The value of a tag with one value per sample, all of which must be equal.
    pub(super) fn equal(&self, tag: Tag, default: u64, what: &str) -> Result<u64, ReadError> {
        let values = self.unsigned(tag)?.unwrap_or_default();
        let first = values.first().copied().unwrap_or(default);
        if values.iter().any(|value| *value != first) {
            return Err(unsupported(format!("holds samples of different {what}")));
        }
        Ok(first)
    }

    /// The values of a tag that holds whole numbers; `None` if it is absent.
    pub(super) fn unsigned(&self, tag: Tag) -> Result<Option<Vec<u64>>, ReadError> {
        let Some((kind, values)) = self.values(tag)? else { return Ok(None) };
        if !matches!(kind, 1 | 3 | 4 | 13 | 16 | 18) {
            return Err(damaged(format!("the TIFF tag {} holds no whole numbers", tag.to_u16())));
        }
        Ok(Some(values.chunks_exact(size_of_kind(kind)).map(|value| number(self.order, value)).collect()))
    }

    /// The first value of a tag, or `default`.
    pub(super) fn first(&self, tag: Tag, default: u64) -> Result<u64, ReadError> {
        Ok(self.unsigned(tag)?.and_then(|values| values.first().copied()).unwrap_or(default))
    }

    /// The first value of a required tag.
    pub(super) fn required(&self, tag: Tag, what: &str) -> Result<u64, ReadError> {
        let value = self.unsigned(tag)?.and_then(|values| values.first().copied());
        value.ok_or_else(|| damaged(format!("the TIFF directory does not say the {what}")))
    }

    /// The bytes of a tag of any type.
    pub(super) fn bytes(&self, tag: Tag) -> Result<Option<Cow<'a, [u8]>>, ReadError> {
        Ok(self.values(tag)?.map(|(_, values)| values))
    }

    /// The values of a tag that holds unsigned fractions or floats.
    pub(super) fn reals(&self, tag: Tag) -> Result<Option<Vec<f64>>, ReadError> {
        let Some((kind, values)) = self.values(tag)? else { return Ok(None) };
        let real = |value: &[u8]| match kind {
            5 => number(self.order, &value[..4]) as f64 / number(self.order, &value[4..]) as f64,
            11 => f64::from(f32::from_bits(number(self.order, value) as u32)),
            12 => f64::from_bits(number(self.order, value)),
            _ => number(self.order, value) as f64,
        };
        Ok(Some(values.chunks_exact(size_of_kind(kind)).map(real).collect()))
    }

    /// The text of a tag, up to its end.
    pub(super) fn text(&self, tag: Tag) -> Result<Option<String>, ReadError> {
        let bytes = self.bytes(tag)?;
        let text = bytes.as_deref().and_then(|bytes| bytes.split(|byte| *byte == 0).next());
        Ok(text.map(|bytes| String::from_utf8_lossy(bytes).trim().to_owned()))
    }
}

/// The number in `bytes`, which are at most eight.
pub(super) fn number(order: ByteOrder, bytes: &[u8]) -> u64 {
    let append = |n: u64, byte: &u8| n << 8 | u64::from(*byte);
    match order {
        ByteOrder::LittleEndian => bytes.iter().rev().fold(0, append),
        ByteOrder::BigEndian => bytes.iter().fold(0, append),
    }
}

/// The number of `size` bytes at `place`; `None` beyond the end.
fn number_at(file: Bytes, order: ByteOrder, place: u64, size: usize) -> Result<Option<u64>, ReadError> {
    Ok(file.get(place, size as u64)?.map(|bytes| number(order, &bytes)))
}

/// Bytes per value of a field type.
fn size_of_kind(kind: u16) -> usize {
    match kind {
        3 | 8 => 2,
        4 | 9 | 11 | 13 => 4,
        5 | 10 | 12 | 16..=18 => 8,
        _ => 1,
    }
}
