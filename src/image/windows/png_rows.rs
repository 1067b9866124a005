//! PNG files, unpacked row by row.

use std::fs::File;
use std::io::BufReader;

use png::{BitDepth, Decoder, Limits, Reader, Transformations};

use crate::image::decode::guarded;
use crate::image::disk::Disk;
use crate::image::file::{MAX_PIXELS_PER_BYTE, check_claim, max_bytes_of};
use crate::image::orientation::Orientation;
use crate::image::raster::{Raster, Samples};

/// A PNG file whose rows are in order.
pub(super) struct Png {
    reader: Reader<BufReader<File>>,
    pub(super) size: (usize, usize),
    pub(super) orientation: Orientation,
    channels: usize,
    is_wide: bool,
}

impl Png {
    /// Opens a file, with the settings that [`decode`](crate::image::decode) has for whole files. `None` for
    /// files with interlaced rows, and for those that it would refuse.
    pub(super) fn open(file: Disk, max_pixels: u64) -> Option<Self> {
        guarded(|| Ok(Self::opened(file, max_pixels))).ok()?
    }

    fn opened(file: Disk, max_pixels: u64) -> Option<Self> {
        let length = file.len();
        let limits = Limits { bytes: usize::try_from(max_bytes_of(max_pixels)).unwrap_or(usize::MAX) };
        let mut decoder = Decoder::new_with_limits(BufReader::new(file.into_file().ok()?), limits);
        decoder.set_ignore_text_chunk(false);
        let header = decoder.read_header_info().ok()?;
        let (width, height, interlaced) = (header.width, header.height, header.interlaced);
        check_claim((width.into(), height.into()), max_pixels, MAX_PIXELS_PER_BYTE, length).ok()?;
        if interlaced {
            return None;
        }
        decoder.set_transformations(Transformations::EXPAND);
        let reader = decoder.read_info().ok()?;
        let (colour, bits) = reader.output_color_type();
        let exif = reader.info().exif_metadata.as_deref();
        Some(Self {
            size: (width as usize, height as usize),
            orientation: exif.map_or(Orientation::UPRIGHT, Orientation::of_exif),
            channels: colour.samples(),
            is_wide: match bits {
                BitDepth::Eight => false,
                BitDepth::Sixteen => true,
                _ => return None,
            },
            reader,
        })
    }

    /// Bytes of the unpacked samples of a row.
    pub(super) fn row_bytes(&self) -> usize {
        self.size.0 * self.channels * if self.is_wide { 2 } else { 1 }
    }

    /// The next `count` rows. `None` if the file is damaged.
    pub(super) fn rows(&mut self, count: usize) -> Option<Raster<'static>> {
        guarded(|| Ok(self.next_rows(count))).ok()?
    }

    fn next_rows(&mut self, count: usize) -> Option<Raster<'static>> {
        let mut bytes = vec![0; self.row_bytes() * count];
        for row in bytes.chunks_exact_mut(self.row_bytes()) {
            self.reader.read_row(row).ok()??;
        }
        let samples = if self.is_wide {
            let words = bytes.as_chunks().0.iter().map(|word| u16::from_be_bytes(*word));
            Samples::Word(words.collect())
        } else {
            Samples::Byte(bytes.into())
        };
        Some(Raster::of((self.size.0, count), self.channels, samples))
    }

    /// Whether the file ends soundly after its rows.
    pub(super) fn ends_soundly(mut self) -> bool {
        guarded(|| Ok(matches!(self.reader.read_row(&mut []), Ok(None)))).unwrap_or(false)
    }
}
