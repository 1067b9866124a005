//! JPEG files. The decoder runs in strict mode, because by default it silently replaces missing or damaged
//! parts with grey. Damage that it misses even so is reported as a doubt about the image.

mod scan;

use std::ops::Range;

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::file::{MAX_PIXELS_PER_BYTE, check_claim, damaged};
use super::orientation::Orientation;
use super::raster::{Raster, Samples};
use crate::error::ReadError;
use crate::memory::{self, Claim};

/// Most bytes per pixel that the decoder needs in addition to the samples: the coefficients of a progressive
/// image, and intermediate rows.
const BYTES_BESIDE: u64 = 10;

/// Decodes a file of at most `max_pixels` pixels.
///
/// # Errors
/// The fault of the file, in one line.
pub(super) fn decode(bytes: &[u8], max_pixels: u64) -> Result<Raster<'static>, ReadError> {
    // The decoder accepts a truncated file.
    if !is_whole(bytes) {
        return Err(damaged("the JPEG data ends too early"));
    }
    let (mut decoder, size) = opened(bytes, max_pixels, bytes.len() as u64)?;
    let (channels, colours) = match decoder.input_colorspace() {
        Some(ColorSpace::Luma) => (1, ColorSpace::Luma),
        _ => (3, ColorSpace::RGB),
    };
    decoder.set_options(options().jpeg_set_out_colorspace(colours));
    let count = size.0 * size.1 * channels;
    let _claim = Claim::new((bytes.len() + count) as u64 + BYTES_BESIDE * (size.0 * size.1) as u64)?;
    let mut samples = memory::filled(count, 0)?;
    decoder.decode_into(&mut samples).map_err(reason)?;
    let orientation = orientation(&mut decoder);
    let doubt = scan::damage(bytes).map(|reason| format!("the JPEG data is damaged: {reason}"));
    Ok(Raster { orientation, doubt, ..Raster::of(size, channels, Samples::Byte(samples.into())) })
}

/// (width, height) and orientation of a file of `length` bytes, of which `bytes` are the first.
#[cfg(not(target_arch = "wasm32"))]
pub(super) fn size(
    bytes: &[u8],
    max_pixels: u64,
    length: u64,
) -> Result<((usize, usize), Orientation), ReadError> {
    let (mut decoder, size) = opened(bytes, max_pixels, length)?;
    Ok((size, orientation(&mut decoder)))
}

type Decoder = JpegDecoder<ZCursor<Vec<u8>>>;

/// The decoder of a file of `length` bytes, with its header read, and (width, height).
fn opened(bytes: &[u8], max_pixels: u64, length: u64) -> Result<(Decoder, (usize, usize)), ReadError> {
    // The decoder of `tiff` reads from a vector too. With a slice here, there would be two copies of its code, and the page waits for both.
    let mut owned = memory::filled(bytes.len(), 0)?;
    owned.copy_from_slice(bytes);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(owned), options());
    decoder.decode_headers().map_err(reason)?;
    let size = decoder.dimensions().ok_or_else(|| damaged("the JPEG file does not say its size"))?;
    check_claim((size.0 as u64, size.1 as u64), max_pixels, MAX_PIXELS_PER_BYTE, length)?;
    Ok((decoder, size))
}

fn options() -> DecoderOptions {
    DecoderOptions::default().set_strict_mode(true).set_max_width(usize::MAX).set_max_height(usize::MAX)
}

fn orientation(decoder: &mut Decoder) -> Orientation {
    decoder.exif().map_or(Orientation::UPRIGHT, |data| Orientation::of_exif(data))
}

/// The segments before the first scan: the kind and the place of each.
pub(super) fn segments(bytes: &[u8]) -> impl Iterator<Item = (u8, Range<usize>)> + '_ {
    let mut at = if bytes.starts_with(&[0xff, 0xd8]) { 2 } else { bytes.len() };
    std::iter::from_fn(move || {
        let &[0xff, marker, a, b] = bytes.get(at..)?.first_chunk()? else { return None };
        let (start, end) = (at + 4, at + 2 + usize::from(u16::from_be_bytes([a, b])));
        at = end;
        (marker != 0xda && start <= end && end <= bytes.len()).then_some((marker, start..end))
    })
}

/// The error of the decoder, without Rust's debug format.
fn reason(e: impl std::fmt::Display) -> ReadError {
    damaged(e.to_string().trim_matches('"').trim_start_matches("[strict-mode]: "))
}

/// Whether the last scan is followed by an end marker. Within a scan, 0xff 0xd9 cannot occur.
fn is_whole(bytes: &[u8]) -> bool {
    let last = |mark: u8| bytes.windows(2).rposition(|w| w == [0xff, mark]);
    matches!((last(0xda), last(0xd9)), (Some(scan), Some(end)) if end > scan)
}
