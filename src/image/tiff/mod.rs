//! TIFF files: selects one image of a file, and converts its samples to levels; writes maps.
//!
//! Tags are those of TIFF 6.0 and its technical notes, and GDAL's tag for no data. A tag that changes the
//! meaning of the samples is either supported or rejected. Resolution, colour profiles and
//! response curves are ignored, as everywhere in [`Reader::pair`](super::read::Reader::pair).

mod cache;
mod chunks;
mod colours;
mod directory;
mod encode;
mod geo;

pub(super) use cache::Cache;
pub(super) use encode::encode;
#[cfg(not(target_arch = "wasm32"))]
pub(super) use encode::{MAX_PLAIN, write_bands};

use std::borrow::Cow;
use std::ops::{Deref, Range};
use std::sync::Arc;

use half::f16;
use tiff::tags::{ByteOrder, Tag};

use self::chunks::Packing;
use self::colours::Colours;
use self::directory::Directory;
use super::Rect;
use super::bytes::Bytes;
use super::file::{MAX_PIXELS_PER_BYTE, check_claim, damaged, unsupported};
use super::georeference::Georeference;
use super::orientation::Orientation;
use super::raster::{Raster, Sample, Samples, holding};
use crate::error::ReadError;
use crate::memory;
use crate::text::quoted;

/// The number type of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Unsigned,
    Signed,
    Float,
}

/// The location of an image's pixels, and their format.
struct Layout {
    width: usize,
    height: usize,
    format: Format,
    /// Samples of a pixel that are read; extra samples after them are skipped.
    read: usize,
    /// Whether each sample has a plane of its own.
    planar: bool,
    /// Width and height of a strip or tile.
    chunk: (usize, usize),
    /// Position of each strip or tile, and its size if the file gives one.
    offsets: Vec<u64>,
    byte_counts: Option<Vec<u64>>,
    /// Columns and rows that share a pair of chroma samples, if chroma is subsampled.
    subsampling: Option<(usize, usize)>,
    packing: Packing,
}

/// Decodes a file of at most `max_pixels` pixels. Pixels whose samples are all `no_data`, or else the no-data
/// value of the file, are marked.
///
/// # Errors
/// A description of the damage, in one line.
pub(super) fn decode(
    file: &[u8],
    max_pixels: u64,
    no_data: Option<f64>,
) -> Result<Raster<'static>, ReadError> {
    let file = Bytes::Held(file);
    let image = Stored::find(file, max_pixels, no_data)?;
    let whole = image.part(file, &Rect::whole(image.size()), None)?;
    Ok(Raster { georeference: image.georeference, orientation: image.orientation, ..whole })
}

/// The image of a file, of which parts can be read.
pub(super) struct Stored {
    layout: Layout,
    colours: Colours,
    no_data: Option<f64>,
    pub(super) georeference: Option<Georeference>,
    pub(super) orientation: Orientation,
}

impl Stored {
    /// Finds the image in `file`, by the rules of [`decode`], without reading its pixels.
    ///
    /// # Errors
    /// A description of the damage, in one line.
    pub(super) fn find(file: Bytes, max_pixels: u64, no_data: Option<f64>) -> Result<Self, ReadError> {
        let directory = Directory::parse(file)?;
        let colours = Colours::from_directory(&directory)?;
        let layout = Layout::from_directory(&directory, &colours, file.len(), max_pixels)?;
        let no_data = no_data.map_or_else(|| no_data_of(&directory), |value| Ok(Some(value)))?;
        let georeference = geo::georeference(&directory);
        // Ignore a damaged orientation tag, which does not affect the pixels.
        let orientation = Orientation::of_tag(directory.first(Tag::Orientation, 1).unwrap_or(1));
        Ok(Self { layout, colours, no_data, georeference, orientation })
    }

    /// (width, height) in pixels.
    pub(super) fn size(&self) -> (usize, usize) {
        (self.layout.width, self.layout.height)
    }

    /// The pixels in `part`, without georeference and orientation. Strips and tiles come from the `cache` where it holds them.
    ///
    /// # Errors
    /// A description of the damage, in one line.
    pub(super) fn part(
        &self,
        file: Bytes,
        part: &Rect,
        cache: Option<&Cache>,
    ) -> Result<Raster<'static>, ReadError> {
        let samples = self.layout.samples((file, cache), part, self.no_data.unwrap_or(0.0))?;
        let holding = |value| holding(&samples, self.layout.read, self.colours.stored(), value);
        let no_data = self.no_data.map(holding).transpose()?;
        let (channels, samples) = self.colours.levels(samples)?;
        Ok(Raster { no_data, ..Raster::of(part.size(), channels, samples) })
    }
}

/// What reading by parts needs beside.
#[cfg(not(target_arch = "wasm32"))]
impl Stored {
    /// Fails where the file is too short for its pixels.
    ///
    /// # Errors
    /// A description of the damage, in one line.
    pub(super) fn check_places(&self, file: Bytes) -> Result<(), ReadError> {
        let (across, down) = self.layout.counts();
        let count = across * down * self.layout.planes_read();
        (0..count).try_for_each(|i| self.layout.place(i, file.len()).map(|_| ()))
    }

    /// Bytes that are unpacked for a single pixel: those of a strip or tile of each plane, or none where rows are not packed.
    /// `None` where the file does not say where each strip or tile ends.
    pub(super) fn unpacked_bytes(&self) -> Option<u64> {
        let layout = &self.layout;
        if !layout.is_packed() {
            return Some(0);
        }
        let rows = layout.stored_rows(0) * layout.planes_read();
        layout.byte_counts.as_ref().map(|_| layout.packing.row_bytes as u64 * rows as u64)
    }

    /// Parts that cover the image, each of about `pixels` pixels, and that together unpack each strip or tile once.
    pub(super) fn pieces(&self, pixels: usize) -> Vec<Rect> {
        let (width, height) = self.size();
        let chunk = self.layout.chunk;
        let (across, down) = (chunk.0.min(width), chunk.1.min(height));
        // Rows that are not packed can be read alone; those that share chroma belong together.
        let down =
            if self.layout.is_packed() { down } else { self.layout.subsampling.map_or(1, |(_, down)| down) };
        let rows = down * (pixels / (width * down)).max(1);
        let columns = if width * rows <= pixels { width } else { across * (pixels / (rows * across)).max(1) };
        let ends = |start: usize, step: usize, end: usize| start..(start + step).min(end);
        let tops = (0..height).step_by(rows);
        tops.flat_map(|y| {
            (0..width)
                .step_by(columns)
                .map(move |x| Rect { x: ends(x, columns, width), y: ends(y, rows, height) })
        })
        .collect()
    }
}

/// The no-data value that GDAL's tag declares.
fn no_data_of(directory: &Directory) -> Result<Option<f64>, ReadError> {
    let Some(text) = directory.text(Tag::GdalNodata)? else { return Ok(None) };
    match text.parse() {
        Ok(value) => Ok(Some(value)),
        // Some programs write an empty tag.
        Err(_) if text.is_empty() => Ok(None),
        Err(_) => Err(ReadError::NoData { value: quoted(&text) }),
    }
}

/// A file, and its strips and tiles that are unpacked already.
type Origin<'a> = (Bytes<'a>, Option<&'a Cache>);

/// Rows of a strip or tile, as stored and unpacked.
struct Rows<'a> {
    bytes: Held<'a>,
    row_bytes: usize,
    /// The first column and row within the strip or tile.
    left: usize,
    top: usize,
}

/// Bytes of rows.
enum Held<'a> {
    Read(Cow<'a, [u8]>),
    Cached(Arc<Vec<u8>>),
}

impl Deref for Held<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Read(bytes) => bytes,
            Self::Cached(bytes) => bytes,
        }
    }
}

impl Layout {
    fn from_directory(
        directory: &Directory,
        colours: &Colours,
        file_bytes: u64,
        max_pixels: u64,
    ) -> Result<Self, ReadError> {
        let size =
            (directory.required(Tag::ImageWidth, "width")?, directory.required(Tag::ImageLength, "height")?);
        check_claim(size, max_pixels, MAX_PIXELS_PER_BYTE, file_bytes)?;
        let (width, height) = (size.0 as usize, size.1 as usize);

        let bits = colours.bits;
        let format = match directory.equal(Tag::SampleFormat, 1, "formats")? {
            // Format 4 is undefined; unsigned is the best guess.
            1 | 4 => Format::Unsigned,
            2 => Format::Signed,
            3 => Format::Float,
            5 | 6 => return Err("holds complex numbers; convert it to their magnitudes".into()),
            other => return Err(unsupported(format!("holds samples of the unknown format {other}"))),
        };
        if !matches!((format, bits), (Format::Unsigned, 1..=64) | (_, 16 | 32 | 64) | (Format::Signed, 8)) {
            return Err(unsupported(format!("holds samples of {bits} bits")));
        }

        let planar = match directory.first(Tag::PlanarConfiguration, 1)? {
            1 => false,
            2 => colours.samples > 1,
            other => {
                return Err(damaged(format!("the TIFF planes are in the unknown configuration {other}")));
            }
        };
        let compression = directory.first(Tag::Compression, chunks::UNCOMPRESSED)?;
        let read = match compression {
            chunks::JPEG => bits == 8,
            chunks::FAX4 => bits == 1 && colours.samples == 1,
            // None, LZW, Deflate under both its numbers, PackBits.
            1 | 5 | 8 | 32_773 | 32_946 => true,
            _ => false,
        };
        if !read {
            let name = match compression {
                2..=4 => " (fax)",
                6 | 7 => " (JPEG)",
                34_887 => " (LERC)",
                34_925 => " (LZMA)",
                50_000 => " (Zstandard)",
                50_001 => " (WebP)",
                _ => "",
            };
            let reason = format!(
                "holds samples of {bits} bits in the compression {compression}{name}, which is not read"
            );
            return Err(unsupported(reason));
        }
        let predictor = match directory.first(Tag::Predictor, 1)? {
            1 => 1,
            _ if compression == chunks::JPEG => 1,
            // Readers disagree: libtiff, for one, ignores the predictor in this case.
            _ if !matches!(compression, 5 | 8 | 32_946) => {
                return Err(unsupported("names a predictor, and is not packed by LZW or Deflate"));
            }
            2 if matches!(bits, 8 | 16 | 32 | 64) => 2,
            3 if format == Format::Float => 3,
            other => {
                return Err(unsupported(format!("holds samples of {bits} bits with the predictor {other}")));
            }
        };
        let reversed = match directory.first(Tag::FillOrder, 1)? {
            1 => false,
            2 => true,
            other => return Err(damaged(format!("the TIFF bits are in the unknown order {other}"))),
        };
        let subsampling = colours.subsampling.filter(|sub| *sub != (1, 1) && compression != chunks::JPEG);
        if subsampling.is_some() && (planar || predictor != 1) {
            return Err(unsupported("holds chroma samples that are stored more sparsely, in planes"));
        }

        let tiled = directory.has(Tag::TileWidth);
        let (chunk, offsets, byte_counts) = if tiled {
            let side = |tag, what| Ok::<_, ReadError>(directory.required(tag, what)?.max(1));
            let chunk =
                (side(Tag::TileWidth, "width of its tiles")?, side(Tag::TileLength, "height of its tiles")?);
            (chunk, Tag::TileOffsets, Tag::TileByteCounts)
        } else {
            let rows = directory.first(Tag::RowsPerStrip, size.1)?.clamp(1, size.1);
            ((size.0, rows), Tag::StripOffsets, Tag::StripByteCounts)
        };
        // Some programs use the tags of strips for their tiles.
        let either =
            |tag, other| if directory.has(tag) { directory.unsigned(tag) } else { directory.unsigned(other) };
        let offsets = either(offsets, Tag::StripOffsets)?;
        let offsets =
            offsets.ok_or_else(|| damaged("the TIFF directory does not say where the pixels are"))?;
        let byte_counts = either(byte_counts, Tag::StripByteCounts)?;

        // Samples of a pixel in a row.
        let samples = if planar { 1 } else { colours.samples };
        let row_bits = match subsampling {
            // A row then consists of units: this many pixels, and the two samples that they share.
            Some((across, down)) => {
                u128::from(chunk.0.div_ceil(across as u64)) * (across * down + 2) as u128 * 8
            }
            None => u128::from(chunk.0) * samples as u128 * u128::from(bits),
        };
        let row_bytes = row_bits.div_ceil(8);
        // Sixteen samples of the widest kind per pixel, and room for a tile of a small picture.
        let max_bytes = u128::from(size.0 * size.1) * 128 + (1 << 26);
        if row_bytes * u128::from(chunk.1) > max_bytes {
            return Err(damaged(format!(
                "the TIFF directory claims {samples} samples in strips or tiles of {} x {} pixels for an image of \
                 {width} x {height}",
                chunk.0, chunk.1
            )));
        }
        let chunk = (chunk.0 as usize, chunk.1 as usize);
        let planes = if planar { colours.samples } else { 1 };
        let count = width.div_ceil(chunk.0) * height.div_ceil(chunk.1) * planes;
        if [Some(offsets.len()), byte_counts.as_ref().map(Vec::len)].into_iter().flatten().any(|n| n < count)
        {
            return Err(damaged(format!(
                "the TIFF directory lists fewer strips or tiles than the {count} it needs"
            )));
        }
        let packing = Packing {
            compression,
            predictor,
            reversed,
            jpeg_tables: directory.bytes(Tag::JPEGTables)?.map(Cow::into_owned),
            order: directory.order,
            bits,
            samples,
            width: chunk.0,
            row_bytes: row_bytes as usize,
        };
        let read = colours.read();
        Ok(Self { width, height, format, read, planar, chunk, offsets, byte_counts, subsampling, packing })
    }

    /// The samples of `part` that are read; `missing` fills strips or tiles that the file omits.
    fn samples(&self, file: Origin, part: &Rect, missing: f64) -> Result<Samples<'static>, ReadError> {
        let (order, bits) = (self.packing.order, self.packing.bits);
        let size = bits as usize / 8;
        let number = |row: &[u8], i: usize| directory::number(order, &row[i * size..(i + 1) * size]);
        let signed = |row: &[u8], i: usize| (number(row, i) << (64 - bits)) as i64 >> (64 - bits);
        let float = missing as f32;
        match (self.format, bits) {
            (Format::Unsigned, 8) => self.assembled(file, part, missing as u8, |row, i| row[i]),
            (Format::Unsigned, 16) => {
                let word = match order {
                    ByteOrder::LittleEndian => u16::from_le_bytes,
                    ByteOrder::BigEndian => u16::from_be_bytes,
                };
                self.assembled(file, part, missing as u16, |row, i| word([row[2 * i], row[2 * i + 1]]))
            }
            (Format::Unsigned, 1..8) => {
                self.assembled(file, part, missing as u8, |row, i| packed(row, i, bits) as u8)
            }
            (Format::Unsigned, 9..16) => {
                self.assembled(file, part, missing as u16, |row, i| packed(row, i, bits) as u16)
            }
            (Format::Unsigned, 24 | 32 | 64) => {
                self.assembled(file, part, missing, |row, i| number(row, i) as f64)
            }
            (Format::Unsigned, _) => {
                self.assembled(file, part, missing, |row, i| packed(row, i, bits) as f64)
            }
            (Format::Signed, 8 | 16) => self.assembled(file, part, float, |row, i| signed(row, i) as f32),
            (Format::Signed, _) => self.assembled(file, part, missing, |row, i| signed(row, i) as f64),
            (Format::Float, 16) => {
                self.assembled(file, part, float, |row, i| f16::from_bits(number(row, i) as u16).to_f32())
            }
            (Format::Float, 32) => {
                self.assembled(file, part, float, |row, i| f32::from_bits(number(row, i) as u32))
            }
            (Format::Float, _) => {
                self.assembled(file, part, missing, |row, i| f64::from_bits(number(row, i)))
            }
        }
    }

    /// Assembles `part` from strips or tiles; `read` extracts sample `i` of a row.
    fn assembled<S: Sample>(
        &self,
        file: Origin,
        part: &Rect,
        missing: S,
        read: impl Fn(&[u8], usize) -> S,
    ) -> Result<Samples<'static>, ReadError> {
        let mut out = memory::filled(part.x.len() * part.y.len() * self.read, missing)?;
        let (across, down) = self.counts();
        let (in_row, samples) = if self.planar { (1, 1) } else { (self.read, self.packing.samples) };
        let covered = |range: &Range<usize>, side: usize| range.start / side..range.end.div_ceil(side);
        for plane in 0..self.planes_read() {
            for (v, u) in covered(&part.y, self.chunk.1)
                .flat_map(|v| covered(&part.x, self.chunk.0).map(move |u| (v, u)))
            {
                let i = (plane * down + v) * across + u;
                let Some(place) = self.place(i, file.0.len())? else { continue };
                let (left, top) = (u * self.chunk.0, v * self.chunk.1);
                let columns = left.max(part.x.start)..(left + self.chunk.0).min(part.x.end);
                let rows = top.max(part.y.start)..(top + self.chunk.1).min(part.y.end);
                let inside =
                    Rect { x: columns.start - left..columns.end - left, y: rows.start - top..rows.end - top };
                let stored = self.stored(file, (i, place), &inside)?;
                let lines = stored.bytes.chunks_exact(stored.row_bytes).skip(inside.y.start - stored.top);
                for (y, row) in rows.zip(lines) {
                    let pixel = (y - part.y.start) * part.x.len() + columns.start - part.x.start;
                    let (start, from) = (pixel * self.read + plane, inside.x.start - stored.left);
                    for x in 0..columns.len() {
                        for c in 0..in_row {
                            out[start + x * self.read + c] = read(row, (from + x) * samples + c);
                        }
                    }
                }
            }
        }
        Ok(S::samples(out.into()))
    }

    /// The rows of strip or tile `i` at `place`, those in `inside` of it at least, with spread chroma.
    fn stored<'a>(
        &self,
        (file, cache): Origin<'a>,
        (i, place): (usize, Range<u64>),
        inside: &Rect,
    ) -> Result<Rows<'a>, ReadError> {
        let down = self.subsampling.map_or(1, |(_, down)| down);
        let get = |start, length| {
            let data = file.get(start, length)?;
            data.ok_or_else(|| damaged("the TIFF pixels end behind the end of the file"))
        };
        let row_bytes = self.packing.row_bytes;
        let mut rows = Rows { bytes: Held::Read(Cow::Borrowed(&[])), row_bytes, left: 0, top: 0 };
        rows.bytes = if self.is_packed() {
            let unpack = || {
                let data = get(place.start, place.end - place.start)?;
                self.packing.rows(data, self.stored_rows(i / self.counts().0 % self.counts().1))
            };
            match cache {
                Some(cache) => Held::Cached(cache.get(i, || unpack().map(Cow::into_owned))?),
                None => Held::Read(unpack()?),
            }
        } else {
            // Rows that are not packed are read alone, and so are a few of their columns.
            let first = inside.y.start / down;
            let count = inside.y.end.div_ceil(down) - first;
            let start = place.start + first as u64 * row_bytes as u64;
            rows.top = first * down;
            let columns = inside.x.start / 8 * 8..inside.x.end;
            let bits = self.packing.samples * self.packing.bits as usize;
            let (skipped, needed) = (columns.start / 8 * bits, (columns.len() * bits).div_ceil(8));
            if self.subsampling.is_some() || needed > row_bytes / 2 {
                let data = get(start, count as u64 * row_bytes as u64)?;
                Held::Read(self.packing.rows(data, count)?)
            } else {
                let mut data = memory::reserved(count * needed)?;
                for y in 0..count as u64 {
                    let start = start + y * row_bytes as u64 + skipped as u64;
                    data.extend_from_slice(&get(start, needed as u64)?);
                }
                (rows.row_bytes, rows.left) = (needed, columns.start);
                Held::Read(self.packing.rows(Cow::Owned(data), count)?)
            }
        };
        if let Some(sub) = self.subsampling {
            let spread = colours::spread(&rows.bytes, self.chunk.0, inside.y.end - rows.top, sub)?;
            rows.bytes = Held::Read(Cow::Owned(spread));
            rows.row_bytes = 3 * self.chunk.0;
        }
        Ok(rows)
    }

    /// Whether rows are compressed.
    fn is_packed(&self) -> bool {
        self.packing.compression != chunks::UNCOMPRESSED
    }

    /// Number of strips or tiles across and down.
    fn counts(&self) -> (usize, usize) {
        (self.width.div_ceil(self.chunk.0), self.height.div_ceil(self.chunk.1))
    }

    /// Number of planes that are read.
    fn planes_read(&self) -> usize {
        if self.planar { self.read } else { 1 }
    }

    /// Rows that are stored inside the image for strips or tiles of row `v` of them.
    fn stored_rows(&self, v: usize) -> usize {
        let rows = self.chunk.1.min(self.height - v * self.chunk.1);
        rows.div_ceil(self.subsampling.map_or(1, |(_, down)| down))
    }

    /// The place of strip or tile `i` in a file of `length` bytes; `None` where GDAL has omitted one without data.
    fn place(&self, i: usize, length: u64) -> Result<Option<Range<u64>>, ReadError> {
        let bytes = self.byte_counts.as_ref().map(|counts| counts[i]);
        if bytes == Some(0) {
            return Ok(None);
        }
        let start = self.offsets[i];
        let left = length.checked_sub(start);
        let left = left.ok_or_else(|| damaged("the TIFF pixels begin behind the end of the file"))?;
        let mut bytes = bytes.unwrap_or(left);
        if bytes > left {
            return Err(damaged("the TIFF pixels end behind the end of the file"));
        }
        if !self.is_packed() {
            // The size is known, even if the file's byte counts are wrong.
            let (across, down) = self.counts();
            bytes = self.packing.row_bytes as u64 * self.stored_rows(i / across % down) as u64;
            if bytes > left {
                return Err(damaged("the TIFF file ends within its pixels"));
            }
        }
        Ok(Some(start..start + bytes))
    }
}

/// Number `i` of `bits` bits in a row, highest bit first.
fn packed(row: &[u8], i: usize, bits: u32) -> u64 {
    let (start, bits) = (i * bits as usize, bits as usize);
    let (first, last) = (start / 8, (start + bits).div_ceil(8));
    let all = row[first..last].iter().fold(0_u128, |n, byte| n << 8 | u128::from(*byte));
    (all >> (8 * last - start - bits) & ((1 << bits) - 1)) as u64
}
