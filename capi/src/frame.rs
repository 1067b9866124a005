//! Frames in the memory of C.

use std::ffi::c_void;
use std::slice;

use mrfgs::Pair;
use mrfgs::image::raster::{Raster, Samples};

use crate::status::Failure;

/// How the pixels of an image are stored. Samples of 16 bits are in the byte order of the machine; they fill their range with the
/// largest value of both images. A pixel whose alpha is 0 is ignored.
#[repr(u32)]
#[derive(Clone, Copy)]
pub enum Format {
    /// Grey, 8 bits.
    Grey8 = 1,
    /// Grey, 16 bits.
    Grey16 = 2,
    /// Red, green and blue, 8 bits each.
    Rgb8 = 3,
    /// Red, green and blue, 16 bits each.
    Rgb16 = 4,
    /// Red, green, blue and alpha, 8 bits each.
    Rgba8 = 5,
    /// Red, green, blue and alpha, 16 bits each.
    Rgba16 = 6,
}

/// Channels and bytes of a sample.
const FORMATS: [(Format, usize, usize); 6] = [
    (Format::Grey8, 1, 1),
    (Format::Grey16, 1, 2),
    (Format::Rgb8, 3, 1),
    (Format::Rgb16, 3, 2),
    (Format::Rgba8, 4, 1),
    (Format::Rgba16, 4, 2),
];

/// An image in memory.
#[repr(C)]
pub struct Image {
    /// The first pixel of the first row.
    pub data: *const c_void,
    /// Bytes from a row to the next one; any number that a row fits into.
    pub stride: usize,
    /// Pixels of a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// An mrfgs_format.
    pub format: u32,
}

impl Image {
    /// Channels and bytes of a sample.
    fn format(&self, name: &str) -> Result<(usize, usize), Failure> {
        match FORMATS.iter().find(|(format, ..)| *format as u32 == self.format) {
            Some(&(_, channels, bytes)) => Ok((channels, bytes)),
            None => {
                Err(Failure::argument(format!("the {name} image has the unknown format {}", self.format)))
            }
        }
    }

    /// The image, borrowed where its rows follow each other.
    ///
    /// # Safety
    /// `data` is null, or holds rows as the fields say, which nobody changes for `'a`.
    unsafe fn raster<'a>(&self, name: &str) -> Result<Raster<'a>, Failure> {
        let (channels, bytes) = self.format(name)?;
        let (width, height) = (self.width as usize, self.height as usize);
        let (row, length) = extent(self.stride, (width, height), channels * bytes).map_err(|wrong| {
            Failure::argument(format!("the {name} image of {width} x {height} pixels {wrong}"))
        })?;
        if self.data.is_null() {
            return Err(Failure::argument(format!("the {name} image has no data: its pointer is null")));
        }
        // SAFETY: it is not null, and the caller promises that the rows are there; their bytes fit into an `isize`.
        let data = unsafe { slice::from_raw_parts::<'a>(self.data.cast::<u8>(), length) };
        if bytes == 1 {
            return Ok(Raster::borrowed(data, (width, height), channels, self.stride)?);
        }
        // Rows may begin at odd addresses.
        let mut words = Vec::new();
        let lacking =
            |_| Failure::memory(format!("a copy of the {name} image cannot be had: give a smaller one"));
        words.try_reserve_exact(row / 2 * height).map_err(lacking)?;
        for line in data.chunks(self.stride) {
            words.extend(line[..row].chunks_exact(2).map(|word| u16::from_ne_bytes([word[0], word[1]])));
        }
        Ok(Raster::new(width, height, channels, Samples::Word(words.into()))?)
    }
}

/// The pair of two images.
///
/// # Safety
/// The images are null or good, and nobody changes their data until this returns.
pub(crate) unsafe fn pair(left: *const Image, right: *const Image) -> Result<Pair, Failure> {
    let null = |name: &str| Failure::argument(format!("the {name} image is null"));
    // SAFETY: the caller promises it.
    let left = unsafe { left.as_ref() }.ok_or_else(|| null("left"))?;
    // SAFETY: the same.
    let right = unsafe { right.as_ref() }.ok_or_else(|| null("right"))?;
    // SAFETY: the same.
    let left = unsafe { left.raster("left") }?;
    // SAFETY: the same.
    let right = unsafe { right.raster("right") }?;
    Ok(Pair::of_frames(left, right)?)
}

/// Bytes of a row, and from the first byte of the first row to the last one of the last row.
///
/// # Errors
/// What is wrong with the stride or the size.
pub(crate) fn extent(
    stride: usize,
    (width, height): (usize, usize),
    pixel: usize,
) -> Result<(usize, usize), String> {
    if width == 0 || height == 0 {
        return Err("holds no pixel".into());
    }
    let row = width.checked_mul(pixel).filter(|row| *row <= stride);
    let row = row.ok_or_else(|| format!("has a stride of {stride} bytes, and a row takes more"))?;
    let length = stride.checked_mul(height - 1).and_then(|before| before.checked_add(row));
    let length = length.filter(|length| isize::try_from(*length).is_ok());
    Ok((row, length.ok_or_else(|| format!("has a stride of {stride} bytes, and no memory holds its rows"))?))
}
