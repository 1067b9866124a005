//! Strips and tiles of TIFF files: converts their bytes to rows of samples, unpacked and with the predictor
//! undone.
//!
//! The `tiff` crate unpacks them, one at a time, as grey rows of bytes that it need not understand. (Its
//! reader for whole images is not enough here, as of 0.11: it rejects or misreads samples of 12 bits,
//! palettes and reversed bits, and panics at planes in tiles.)

use std::borrow::Cow;
use std::io::Cursor;

use tiff::decoder::{Decoder, Limits};
use tiff::encoder::TiffEncoder;
use tiff::tags::{ByteOrder, Tag};
use tiff::{TiffError, TiffResult};

use super::directory;
use crate::error::ReadError;
use crate::image::file::{damaged, unsupported};
use crate::memory;

pub(super) const UNCOMPRESSED: u64 = 1;
pub(super) const FAX4: u64 = 4;
pub(super) const JPEG: u64 = 7;

/// How the rows of a strip or tile are stored.
pub(super) struct Packing {
    /// The value of the tag.
    pub(super) compression: u64,
    pub(super) predictor: u64,
    /// Whether the first bit of a byte is the lowest.
    pub(super) reversed: bool,
    /// Tables shared by all strips or tiles.
    pub(super) jpeg_tables: Option<Vec<u8>>,
    pub(super) order: ByteOrder,
    pub(super) bits: u32,
    /// Samples of a pixel in a row: one where each channel has its own plane.
    pub(super) samples: usize,
    /// Width in pixels, including the part beyond the image.
    pub(super) width: usize,
    /// Bytes of a row.
    pub(super) row_bytes: usize,
}

impl Packing {
    /// The first `rows` rows of a strip or tile, of which `data` holds all bytes, or those of these rows if they are not packed.
    ///
    /// # Errors
    /// A description of the damage, in one line.
    pub(super) fn rows<'a>(&self, mut data: Cow<'a, [u8]>, rows: usize) -> Result<Cow<'a, [u8]>, ReadError> {
        if self.reversed && self.compression != JPEG {
            let mut copy = memory::filled(data.len(), 0_u8)?;
            copy.iter_mut().zip(&*data).for_each(|(to, from)| *to = from.reverse_bits());
            data = Cow::Owned(copy);
        }
        let mut rows =
            if self.compression == UNCOMPRESSED { data } else { Cow::Owned(self.unpacked(&data, rows)?) };
        if self.predictor != 1 {
            rows.to_mut().chunks_exact_mut(self.row_bytes).for_each(|row| self.undo_predictor(row));
        }
        Ok(rows)
    }

    /// Unpacks data with the `tiff` crate, as a file that holds nothing but one grey strip.
    fn unpacked(&self, data: &[u8], rows: usize) -> Result<Vec<u8>, ReadError> {
        if self.compression == JPEG {
            let frame =
                jpeg_frame(data).ok_or_else(|| damaged("a JPEG strip or tile does not say its size"))?;
            let [height, width, components] = frame;
            // The decoder trusts the frame.
            if (width, components) != (self.width, self.samples) || height < rows {
                return Err(damaged("a JPEG strip or tile does not have the size that its header says"));
            }
        }
        // The fax decoder counts in pixels.
        let (width, bits) = if self.compression == FAX4 { (self.width, 1_u16) } else { (self.row_bytes, 8) };
        let number =
            |n: usize| u32::try_from(n).map_err(|_| unsupported("a TIFF strip or tile is too large"));
        let (width, height, length) = (number(width)?, number(rows)?, number(data.len())?);
        // Reserve room for the directory.
        let room = data.len() + self.jpeg_tables.as_ref().map_or(0, Vec::len) + 1024;
        let mut file = Cursor::new(memory::reserved(room)?);
        let mut write = || -> TiffResult<()> {
            let mut encoder = TiffEncoder::new(&mut file)?;
            let mut strip = encoder.image_directory()?;
            let place = strip.write_data(data)? as u32;
            strip.write_tag(Tag::ImageWidth, width)?;
            strip.write_tag(Tag::ImageLength, height)?;
            strip.write_tag(Tag::BitsPerSample, bits)?;
            strip.write_tag(Tag::Compression, self.compression as u16)?;
            strip.write_tag(Tag::PhotometricInterpretation, 1_u16)?;
            strip.write_tag(Tag::StripOffsets, place)?;
            strip.write_tag(Tag::RowsPerStrip, height)?;
            strip.write_tag(Tag::StripByteCounts, length)?;
            if let Some(tables) = self.jpeg_tables.as_deref().filter(|tables| !tables.is_empty()) {
                strip.write_tag(Tag::JPEGTables, tables)?;
            }
            strip.finish()
        };
        let reason = |e: TiffError| match e {
            TiffError::UnsupportedError(_) => unsupported(e),
            _ => damaged(e),
        };
        write().map_err(reason)?;
        file.set_position(0);
        let mut out = memory::filled(self.row_bytes * rows, 0)?;
        let decoder = Decoder::new(file).map_err(reason)?;
        decoder.with_limits(Limits::unlimited()).read_chunk_bytes(0, &mut out).map_err(reason)?;
        Ok(out)
    }

    /// Replaces the differences in a row by the values.
    fn undo_predictor(&self, row: &mut [u8]) {
        let size = self.bits as usize / 8;
        let store = |to: &mut [u8], value: u64| match self.order {
            ByteOrder::LittleEndian => to.copy_from_slice(&value.to_le_bytes()[..size]),
            ByteOrder::BigEndian => to.copy_from_slice(&value.to_be_bytes()[8 - size..]),
        };
        let floats = self.predictor == 3;
        // Differences are between samples or, for floats, between their bytes in planes, the highest byte
        // first.
        let step = if floats { 1 } else { size };
        let distance = self.samples * step;
        if step == 1 {
            for i in distance..row.len() {
                row[i] = row[i].wrapping_add(row[i - distance]);
            }
        } else {
            for i in (distance..row.len()).step_by(step) {
                let number = |row: &[u8], at: usize| directory::number(self.order, &row[at..at + step]);
                let sum = number(row, i).wrapping_add(number(row, i - distance));
                store(&mut row[i..i + step], sum);
            }
        }
        if floats {
            let planes = row.to_vec();
            let count = row.len() / size;
            for (i, value) in row.chunks_exact_mut(size).enumerate() {
                let bytes = (0..size).map(|b| planes[b * count + i]);
                store(value, bytes.fold(0, |n, byte| n << 8 | u64::from(byte)));
            }
        }
    }
}

/// Height, width and number of components that a JPEG stream claims.
fn jpeg_frame(data: &[u8]) -> Option<[usize; 3]> {
    let mut at = 2;
    loop {
        let &[0xff, mark, a, b, ..] = data.get(at..)? else { return None };
        match mark {
            0xff => at += 1,
            // Markers without a segment.
            0x01 | 0xd0..=0xd8 => at += 2,
            0xc0..=0xcf if !matches!(mark, 0xc4 | 0xc8 | 0xcc) => {
                let [_, h, i, w, j, components] = *data.get(at + 4..at + 10)?.first_chunk()?;
                let size = |a, b| usize::from(u16::from_be_bytes([a, b]));
                return Some([size(h, i), size(w, j), usize::from(components)]);
            }
            _ => at += 2 + usize::from(u16::from_be_bytes([a, b])),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The packing of a row of four samples of 16 bits or more.
    fn packing(bits: u32, samples: usize, predictor: u64, order: ByteOrder) -> Packing {
        let (width, row_bytes) = (4, 4 * samples * bits as usize / 8);
        Packing {
            compression: UNCOMPRESSED,
            predictor,
            reversed: false,
            jpeg_tables: None,
            order,
            bits,
            samples,
            width,
            row_bytes,
        }
    }

    #[test]
    fn differences_are_summed_in_either_byte_order() {
        // 1, 300, 65535, 4 and their differences, modulo 2^16.
        let (values, differences) = ([1_u16, 300, 65_535, 4], [1_u16, 299, 65_235, 5]);
        for (order, bytes) in [
            (ByteOrder::LittleEndian, u16::to_le_bytes as fn(u16) -> [u8; 2]),
            (ByteOrder::BigEndian, u16::to_be_bytes as fn(u16) -> [u8; 2]),
        ] {
            let stored = differences.map(bytes).concat();
            let rows = packing(16, 1, 2, order).rows(Cow::Borrowed(&stored), 1).unwrap();
            assert_eq!(*rows, values.map(bytes).concat(), "{order:?}");
            let plain = packing(16, 1, 1, order).rows(Cow::Borrowed(&stored), 1).unwrap();
            assert_eq!(*plain, stored, "control");
        }
    }

    #[test]
    fn differences_of_floats_are_undone_by_byte_planes() {
        let values = [1.5_f32, -2.25, 3e7, 0.0];
        let planes: Vec<u8> = (0..4).flat_map(|b| values.map(|v| v.to_be_bytes()[b])).collect();
        let mut stored = planes.clone();
        for i in (1..stored.len()).rev() {
            stored[i] = stored[i].wrapping_sub(planes[i - 1]);
        }
        let rows = packing(32, 1, 3, ByteOrder::LittleEndian).rows(Cow::Borrowed(&stored), 1).unwrap();
        assert_eq!(*rows, values.map(f32::to_le_bytes).concat());
    }

    #[test]
    fn the_frame_of_a_jpeg_stream_is_found() {
        let stream = [0xff, 0xd8, 0xff, 0xe0, 0, 4, 1, 2, 0xff, 0xff, 0xc2, 0, 17, 8, 1, 2, 0, 9, 3];
        assert_eq!(jpeg_frame(&stream), Some([258, 9, 3]));
        for length in 0..stream.len() {
            assert_eq!(jpeg_frame(&stream[..length]), None, "{length}");
        }
    }
}
