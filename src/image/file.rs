//! Reads the bytes of image files, and limits the claims of their headers.

use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

use crate::error::{Error, Purpose, ReadError, Result};
use crate::memory;
use crate::text::one_line;

/// Default limit for the number of pixels of an image: 16,384 x 16,384.
pub const MAX_PIXELS: u64 = 1 << 28;

/// No supported codec packs more pixels into a byte, so a header that claims more is wrong.
pub(super) const MAX_PIXELS_PER_BYTE: u64 = 10_000;

/// Largest number of bytes per pixel: four channels of the widest kind.
const PIXEL_BYTES: u64 = 32;

/// Largest number of bytes of a file that are not pixels: headers, profiles, previews.
const EXTRA_BYTES: u64 = 1 << 26;

/// Largest number of bytes that `pixels` pixels take, in a file or decoded, with everything else in the file.
pub(super) fn max_bytes_of(pixels: u64) -> u64 {
    pixels.saturating_mul(PIXEL_BYTES).saturating_add(EXTRA_BYTES)
}

/// The bytes of a file, unless it is too large for an image of `max_pixels` pixels. `refused` gets the first
/// bytes, and returns a reason not to read the rest, which may be large or endless.
pub(super) fn load(
    path: &Path,
    max_pixels: u64,
    refused: impl FnOnce(&[u8]) -> Option<String>,
) -> Result<Vec<u8>> {
    let max_bytes = max_bytes_of(max_pixels);
    let error = |reason: &str| Err(Error::read(path, reason));
    let io = |e| Error::opening(path, e);
    let metadata = fs::metadata(path).map_err(io)?;
    if metadata.is_dir() {
        return error("is a folder; give the image file");
    }
    if metadata.len() > max_bytes {
        return Err(Error::read(path, ReadError::TooManyBytes { limit: max_pixels }));
    }
    memory::check(metadata.len(), Purpose::Image).map_err(|e| Error::read(path, e))?;
    let mut file = File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    file.by_ref().take(64).read_to_end(&mut bytes).map_err(io)?;
    if bytes.is_empty() {
        return error("the file is empty; get it again");
    }
    if let Some(reason) = refused(&bytes) {
        return Err(Error::read(path, reason));
    }
    file.take(max_bytes).read_to_end(&mut bytes).map_err(io)?;
    Ok(bytes)
}

/// Fails for images without pixels, and with more than `max_pixels`.
pub(super) fn check_size(width: u64, height: u64, max_pixels: u64) -> Result<(), ReadError> {
    if width == 0 || height == 0 {
        return Err(format!("is {width} x {height} and holds no pixel").into());
    }
    if width.checked_mul(height).is_none_or(|n| n > max_pixels) {
        return Err(ReadError::TooManyPixels { width, height, limit: max_pixels });
    }
    Ok(())
}

/// Like [`check_size`]; also fails when `bytes` bytes cannot hold so many pixels, at `per_byte` pixels per
/// byte.
pub(super) fn check_claim(
    (width, height): (u64, u64),
    max_pixels: u64,
    per_byte: u64,
    bytes: u64,
) -> Result<(), ReadError> {
    check_size(width, height, max_pixels)?;
    if width * height > per_byte.saturating_mul(bytes) {
        return Err(format!(
            "claims {width} x {height} pixels in {bytes} bytes: truncated or damaged; get the file again"
        )
        .into());
    }
    Ok(())
}

/// The error for a file that cannot be decoded, with the remedy.
pub(super) fn damaged(e: impl std::fmt::Display) -> ReadError {
    let reason = one_line(&e.to_string());
    format!("{reason}; truncated or damaged? get the file again, or convert it to PNG").into()
}

/// The error for a file that a decoder does not support, with the remedy.
pub(super) fn unsupported(e: impl std::fmt::Display) -> ReadError {
    format!("{}; convert it to PNG", one_line(&e.to_string())).into()
}
