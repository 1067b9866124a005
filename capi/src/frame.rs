//! Frames in C's memory.

use std::ffi::c_void;
use std::slice;

use mrfgs::Pair;
use mrfgs::image::Plane;
use mrfgs::image::raster::{Raster, Samples};

use crate::status::Failure;

/// How the pixels of an image are stored. Samples of more than 8 bits are in native byte order. 16 bits are scaled by the largest value of
/// both images; floats are scaled from the smallest to the largest value of both, and non-finite ones are ignored. Pixels with alpha 0 are
/// ignored.
#[repr(u32)]
#[derive(Clone, Copy, PartialEq)]
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
    /// Grey, float of 32 bits.
    Grey32f = 7,
    /// Blue, green and red, 8 bits each, as OpenCV has them.
    Bgr8 = 8,
    /// Blue, green and red, 16 bits each.
    Bgr16 = 9,
    /// Blue, green, red and alpha, 8 bits each.
    Bgra8 = 10,
    /// Blue, green, red and alpha, 16 bits each.
    Bgra16 = 11,
}

/// The type of a sample.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Sample {
    Byte,
    Word,
    Float,
}

impl Sample {
    pub(crate) fn bytes(self) -> usize {
        match self {
            Self::Byte => 1,
            Self::Word => 2,
            Self::Float => 4,
        }
    }
}

/// The layout of a pixel.
#[derive(Clone, Copy)]
pub(crate) struct Layout {
    pub(crate) sample: Sample,
    pub(crate) channels: usize,
    /// Whether blue comes first.
    pub(crate) is_bgr: bool,
}

const LAYOUTS: [(Format, Sample, usize, bool); 11] = [
    (Format::Grey8, Sample::Byte, 1, false),
    (Format::Grey16, Sample::Word, 1, false),
    (Format::Rgb8, Sample::Byte, 3, false),
    (Format::Rgb16, Sample::Word, 3, false),
    (Format::Rgba8, Sample::Byte, 4, false),
    (Format::Rgba16, Sample::Word, 4, false),
    (Format::Grey32f, Sample::Float, 1, false),
    (Format::Bgr8, Sample::Byte, 3, true),
    (Format::Bgr16, Sample::Word, 3, true),
    (Format::Bgra8, Sample::Byte, 4, true),
    (Format::Bgra16, Sample::Word, 4, true),
];

impl Layout {
    /// The layout of an mrfgs_format.
    pub(crate) fn of(format: u32, name: &str) -> Result<Self, Failure> {
        match LAYOUTS.iter().find(|(known, ..)| *known as u32 == format) {
            Some(&(_, sample, channels, is_bgr)) => Ok(Self { sample, channels, is_bgr }),
            None => Err(Failure::argument(format!(
                "the {name} has the unknown format {format}; give an mrfgs_format, 1 to {}",
                LAYOUTS.len()
            ))),
        }
    }

    pub(crate) fn pixel_bytes(self) -> usize {
        self.channels * self.sample.bytes()
    }
}

/// An image in memory.
#[repr(C)]
pub struct Image {
    /// The first pixel of the first row.
    pub data: *const c_void,
    /// Bytes from one row to the next, at least the bytes of a row.
    pub stride: usize,
    /// Pixels of a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// An mrfgs_format.
    pub format: u32,
}

impl Image {
    /// The bytes of all rows, and the number of bytes of one row.
    ///
    /// # Safety
    /// `data` is null, or contains rows as the fields say, unchanged for `'a`.
    unsafe fn rows<'a>(&self, name: &str, pixel: usize) -> Result<(&'a [u8], usize), Failure> {
        let (width, height) = (self.width as usize, self.height as usize);
        let (row, length) = extent(self.stride, (width, height), pixel)
            .map_err(|wrong| Failure::argument(format!("the {name} of {width} x {height} pixels {wrong}")))?;
        if self.data.is_null() {
            return Err(Failure::argument(format!("the {name} has no data: its pointer is null")));
        }
        // SAFETY: it is not null, the caller guarantees that the rows exist, and their size fits into an `isize`.
        Ok((unsafe { slice::from_raw_parts::<'a>(self.data.cast::<u8>(), length) }, row))
    }

    /// The image, borrowed if its bytes have the library's layout.
    ///
    /// # Safety
    /// As for `rows`.
    unsafe fn raster<'a>(&self, name: &str) -> Result<Raster<'a>, Failure> {
        let layout = Layout::of(self.format, name)?;
        let size = (self.width as usize, self.height as usize);
        // SAFETY: guaranteed by the caller.
        let (data, row) = unsafe { self.rows(name, layout.pixel_bytes()) }?;
        if layout.sample == Sample::Byte && !layout.is_bgr {
            return Ok(Raster::borrowed(data, size, layout.channels, self.stride)?);
        }
        let lines = || data.chunks(self.stride).map(|line| &line[..row]);
        let count = row / layout.sample.bytes() * size.1;
        let samples = match layout.sample {
            Sample::Byte => Samples::Byte(copied(lines(), count, layout, name, u8::from_ne_bytes)?.into()),
            Sample::Word => Samples::Word(copied(lines(), count, layout, name, u16::from_ne_bytes)?.into()),
            Sample::Float => Samples::Float(copied(lines(), count, layout, name, f32::from_ne_bytes)?.into()),
        };
        Ok(Raster::new(size.0, size.1, layout.channels, samples)?)
    }

    /// A mask, set where samples are not 0.
    ///
    /// # Safety
    /// As for `rows`.
    unsafe fn mask(&self, name: &str) -> Result<Plane<bool>, Failure> {
        if self.format != Format::Grey8 as u32 {
            return Err(Failure::argument(format!(
                "the {name} has the format {}; give MRFGS_FORMAT_GREY8",
                self.format
            )));
        }
        // SAFETY: guaranteed by the caller.
        let (data, row) = unsafe { self.rows(name, 1) }?;
        let masked = data.chunks(self.stride).flat_map(|line| line[..row].iter().map(|v| *v != 0));
        Ok(Plane::new(self.width as usize, self.height as usize, masked.collect()))
    }
}

/// The samples of rows, which may be unaligned, in RGB order.
fn copied<'a, T, const BYTES: usize>(
    lines: impl Iterator<Item = &'a [u8]>,
    count: usize,
    layout: Layout,
    name: &str,
    value: fn([u8; BYTES]) -> T,
) -> Result<Vec<T>, Failure> {
    let mut samples = Vec::new();
    let lacking = |_| Failure::memory(format!("cannot allocate a copy of the {name}: give a smaller one"));
    samples.try_reserve_exact(count).map_err(lacking)?;
    for line in lines {
        samples.extend(line.as_chunks().0.iter().map(|bytes| value(*bytes)));
    }
    if layout.is_bgr {
        samples.chunks_exact_mut(layout.channels).for_each(|pixel| pixel.swap(0, 2));
    }
    Ok(samples)
}

/// The pair of two images, without masked pixels; masks may be null.
///
/// # Safety
/// The images and masks are null or valid, and their data does not change until this returns.
pub(crate) unsafe fn pair(images: [*const Image; 2], masks: [*const Image; 2]) -> Result<Pair, Failure> {
    // SAFETY: guaranteed by the caller.
    let [left, right] = unsafe { rasters(images, masks) }?;
    Ok(Pair::of_frames(left, right)?)
}

/// The pair of two raw images, which may differ in size.
///
/// # Safety
/// Each image is null, or valid as `mrfgs_image` demands.
pub(crate) unsafe fn raw_pair(images: [*const Image; 2]) -> Result<Pair, Failure> {
    // SAFETY: guaranteed by the caller.
    let [left, right] = unsafe { rasters(images, [std::ptr::null(); 2]) }?;
    Ok(Pair::of_raw_frames(left, right)?)
}

/// # Safety
/// Each image is null, or valid as `mrfgs_image` demands.
unsafe fn rasters<'a>(
    images: [*const Image; 2],
    masks: [*const Image; 2],
) -> Result<[Raster<'a>; 2], Failure> {
    const NAMES: [[&str; 2]; 2] =
        [["left image", "mask of the left image"], ["right image", "mask of the right image"]];
    let view = |i: usize| {
        let [name, mask_name] = NAMES[i];
        // SAFETY: guaranteed by the caller.
        let image = unsafe { images[i].as_ref() };
        let image = image.ok_or_else(|| Failure::argument(format!("the {name} is null")))?;
        // SAFETY: as above.
        let raster = unsafe { image.raster(name) }?;
        // SAFETY: as above.
        let Some(mask) = (unsafe { masks[i].as_ref() }) else { return Ok(raster) };
        // SAFETY: as above.
        let mask = unsafe { mask.mask(mask_name) }?;
        raster.masked_by(mask).map_err(|error| Failure::argument(format!("the {mask_name}: {error}")))
    };
    Ok([view(0)?, view(1)?])
}

/// The bytes of a row, and the bytes from the start of the first row to the end of the last row.
///
/// # Errors
/// The fault of the stride or the size.
pub(crate) fn extent(
    stride: usize,
    (width, height): (usize, usize),
    pixel: usize,
) -> Result<(usize, usize), String> {
    if width == 0 || height == 0 {
        return Err("has no pixels".into());
    }
    let row = width.checked_mul(pixel).filter(|row| *row <= stride);
    let row = row.ok_or_else(|| format!("has a stride of {stride} bytes, less than a row needs"))?;
    let length = stride.checked_mul(height - 1).and_then(|before| before.checked_add(row));
    let length = length.filter(|length| isize::try_from(*length).is_ok());
    Ok((row, length.ok_or_else(|| format!("has a stride of {stride} bytes, too large for memory"))?))
}
