//! Decoding image files: what they are by their first bytes, and their samples as they stand.

use std::fs::{self, File};
use std::io::{Cursor, Read};
use std::path::Path;

use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};
use tiff::TiffError;
use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::Tag;

use super::pfm;
use super::raster::{Raster, Samples};
use crate::error::{Error, Result, one_line};

/// Bytes of a pixel at most: four channels of the widest kind.
const PIXEL_BYTES: u64 = 32;

/// Bytes of a file that are no pixels, at most: headers, profiles, previews.
const EXTRA_BYTES: u64 = 1 << 26;

/// No codec here packs more pixels than this into a byte; a header that claims more lies, and believing it
/// would cost memory in vain.
const MAX_PIXELS_PER_BYTE: u64 = 10_000;

/// The same for files that do not compress, whose smallest pixel is a bit.
const MAX_PLAIN_PIXELS_PER_BYTE: u64 = 8;

/// Bytes that `pixels` pixels take at most, in a file or decoded, and whatever comes with them.
fn most_bytes(pixels: u64) -> u64 {
    pixels.saturating_mul(PIXEL_BYTES).saturating_add(EXTRA_BYTES)
}

/// The bytes of a file that begins like an image and is not too large for one of `max_pixels` pixels.
pub(super) fn load(path: &Path, max_pixels: u64) -> Result<Vec<u8>> {
    let max_bytes = most_bytes(max_pixels);
    let error = |reason: &str| Err(Error::read(path, reason));
    let io = |e: std::io::Error| match e.kind() {
        std::io::ErrorKind::NotFound => Error::read(path, "there is no such file; check the name"),
        _ => Error::read(path, e),
    };
    let metadata = fs::metadata(path).map_err(io)?;
    if metadata.is_dir() {
        return error("is a folder; give the image file");
    }
    if metadata.len() > max_bytes {
        return Err(Error::read(
            path,
            format!("has more bytes than {max_pixels} pixels can take; raise --max-pixels or crop it"),
        ));
    }
    let mut file = File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    // Looking at the beginning first spares reading a large file that is no image, or one without end.
    file.by_ref().take(64).read_to_end(&mut bytes).map_err(io)?;
    if bytes.is_empty() {
        return error("the file is empty; get it again");
    }
    if Kind::of(&bytes).is_none() {
        return Err(Error::read(path, unknown(&bytes)));
    }
    file.take(max_bytes).read_to_end(&mut bytes).map_err(io)?;
    Ok(bytes)
}

/// Errors when an image of this size will not be read: it has no pixel, or more than `max_pixels`.
pub(super) fn check_size(width: u64, height: u64, max_pixels: u64) -> std::result::Result<(), String> {
    if width == 0 || height == 0 {
        return Err(format!("is {width} x {height} and holds no pixel"));
    }
    if width.checked_mul(height).is_none_or(|n| n > max_pixels) {
        return Err(format!(
            "claims {width} x {height} pixels and at most {max_pixels} are read; if that is true, raise --max-pixels \
             or crop it"
        ));
    }
    Ok(())
}

/// As [`check_size`], and errors when `bytes` cannot hold so many pixels.
fn check_claim(
    width: u64,
    height: u64,
    max_pixels: u64,
    per_byte: u64,
    bytes: &[u8],
) -> std::result::Result<(), String> {
    check_size(width, height, max_pixels)?;
    if width * height > per_byte * bytes.len() as u64 {
        return Err(format!(
            "claims {width} x {height} pixels in {} bytes: truncated or damaged; get the file again",
            bytes.len()
        ));
    }
    Ok(())
}

/// What a file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Pfm,
    Tiff,
    Coded(ImageFormat),
}

impl Kind {
    pub(super) fn of(bytes: &[u8]) -> Option<Self> {
        if pfm::is_pfm(bytes) {
            return Some(Self::Pfm);
        }
        Some(match bytes {
            [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => Self::Tiff,
            [0x89, b'P', b'N', b'G', b'\r', b'\n', 0x1a, b'\n', ..] => Self::Coded(ImageFormat::Png),
            [0xff, 0xd8, 0xff, ..] => Self::Coded(ImageFormat::Jpeg),
            [b'P', b'1'..=b'7', c, ..] if c.is_ascii_whitespace() || *c == b'#' => {
                Self::Coded(ImageFormat::Pnm)
            }
            _ => return None,
        })
    }
}

/// The message for a file that is none of the known kinds.
fn unknown(bytes: &[u8]) -> String {
    const REMEDY: &str = "give PNG, JPEG, PNM, TIFF or PFM";
    match image::guess_format(bytes) {
        Ok(ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Pnm | ImageFormat::Tiff) | Err(_) => {
            format!("not an image of a known format; {REMEDY}")
        }
        Ok(other) => format!("is a {} file; {REMEDY}", other.extensions_str()[0]),
    }
}

pub(super) fn decode_file(path: &Path, max_pixels: u64) -> Result<Raster<'static>> {
    decode(&load(path, max_pixels)?, max_pixels).map_err(|reason| Error::read(path, reason))
}

/// Decodes a whole file; the error says in one line what is wrong with it. Memory for pixels is taken once the header
/// is known to claim no more than `max_pixels`, and what the file can hold.
pub(super) fn decode(bytes: &[u8], max_pixels: u64) -> std::result::Result<Raster<'static>, String> {
    match Kind::of(bytes) {
        Some(Kind::Pfm) => decode_pfm(bytes, max_pixels),
        Some(Kind::Tiff) => decode_tiff(bytes, max_pixels),
        Some(Kind::Coded(format)) => decode_coded(bytes, format, max_pixels),
        None => Err(unknown(bytes)),
    }
}

fn decode_pfm(bytes: &[u8], max_pixels: u64) -> std::result::Result<Raster<'static>, String> {
    let (width, height, channels, samples) = match pfm::decode(bytes, max_pixels)? {
        pfm::Pfm::Grey(p) => (p.width(), p.height(), 1, p.into_data()),
        pfm::Pfm::Colour(p) => (p.width(), p.height(), 3, p.into_data().into_flattened()),
    };
    Ok(Raster { width, height, channels, samples: Samples::Float(samples.into()) })
}

/// What is wrong with a file that does not decode, and what to do about it.
fn damaged(e: impl std::fmt::Display) -> String {
    format!("{}; truncated or damaged? get the file again, or convert it to PNG", one_line(&e.to_string()))
}

/// What a decoder does not know, and what to do about it.
fn unsupported(e: impl std::fmt::Display) -> String {
    format!("{}; convert it to PNG", one_line(&e.to_string()))
}

/// The error of the general decoder.
fn coded_reason(e: ImageError) -> String {
    if matches!(e, ImageError::Unsupported(_)) { unsupported(e) } else { damaged(e) }
}

/// The error of the TIFF decoder.
fn tiff_reason(e: TiffError) -> String {
    if matches!(e, TiffError::UnsupportedError(_)) { unsupported(e) } else { damaged(e) }
}

fn decode_coded(
    bytes: &[u8],
    format: ImageFormat,
    max_pixels: u64,
) -> std::result::Result<Raster<'static>, String> {
    // The decoder fills up what is missing of a JPEG file with grey and says nothing.
    if format == ImageFormat::Jpeg && !jpeg_is_whole(bytes) {
        return Err(damaged("the JPEG data has no end"));
    }
    // What else is in a PNG file, compressed as well, is unpacked before the decoder tells the size.
    let claimed = if format == ImageFormat::Png {
        let (width, height) = png_size(bytes)?;
        check_size(width, height, max_pixels)?;
        width * height
    } else {
        max_pixels
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(most_bytes(claimed));
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(coded_reason)?;
    let (width, height) = decoder.dimensions();
    let plain = format == ImageFormat::Pnm;
    let per_byte = if plain { MAX_PLAIN_PIXELS_PER_BYTE } else { MAX_PIXELS_PER_BYTE };
    check_claim(width as u64, height as u64, max_pixels, per_byte, bytes)?;
    let image = DynamicImage::from_decoder(decoder).map_err(coded_reason)?;
    let (channels, samples) = match image {
        DynamicImage::ImageLuma8(i) => (1, Samples::Byte(i.into_raw().into())),
        DynamicImage::ImageLumaA8(i) => (2, Samples::Byte(i.into_raw().into())),
        DynamicImage::ImageRgb8(i) => (3, Samples::Byte(i.into_raw().into())),
        DynamicImage::ImageRgba8(i) => (4, Samples::Byte(i.into_raw().into())),
        DynamicImage::ImageLuma16(i) => (1, Samples::Word(i.into_raw().into())),
        DynamicImage::ImageLumaA16(i) => (2, Samples::Word(i.into_raw().into())),
        DynamicImage::ImageRgb16(i) => (3, Samples::Word(i.into_raw().into())),
        DynamicImage::ImageRgba16(i) => (4, Samples::Word(i.into_raw().into())),
        DynamicImage::ImageRgb32F(i) => (3, Samples::Float(i.into_raw().into())),
        DynamicImage::ImageRgba32F(i) => (4, Samples::Float(i.into_raw().into())),
        other => {
            return Err(format!("pixels of the kind {:?} are not read; convert it to PNG", other.color()));
        }
    };
    Ok(Raster { width: width as usize, height: height as usize, channels, samples })
}

/// (width, height) that a PNG file claims, by the header that must come first.
fn png_size(bytes: &[u8]) -> std::result::Result<(u64, u64), String> {
    match bytes.get(8..24) {
        Some([0, 0, 0, 13, b'I', b'H', b'D', b'R', a, b, c, d, e, f, g, h]) => {
            Ok((u32::from_be_bytes([*a, *b, *c, *d]).into(), u32::from_be_bytes([*e, *f, *g, *h]).into()))
        }
        _ => Err(damaged("the PNG file does not begin with its header")),
    }
}

/// Whether the last scan of a JPEG file is followed by an end mark. Within a scan, 0xff 0xd9 cannot occur.
fn jpeg_is_whole(bytes: &[u8]) -> bool {
    let last = |mark: u8| bytes.windows(2).rposition(|w| w == [0xff, mark]);
    matches!((last(0xda), last(0xd9)), (Some(scan), Some(end)) if end > scan)
}

/// Integer and float TIFF. What is packed into less than a byte, or is neither grey nor RGB, is left to the
/// general decoder.
fn decode_tiff(bytes: &[u8], max_pixels: u64) -> std::result::Result<Raster<'static>, String> {
    check_tiff_directory(bytes)?;
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(tiff_reason)?;
    let (width, height) = decoder.dimensions().map_err(tiff_reason)?;
    check_claim(width as u64, height as u64, max_pixels, MAX_PIXELS_PER_BYTE, bytes)?;
    // Sixteen samples of the widest kind for a pixel, and room for a strip of a small picture.
    let most = (width as usize * height as usize).saturating_mul(128).saturating_add(1 << 26);
    let mut limits = tiff::decoder::Limits::unlimited();
    limits.decoding_buffer_size = most;
    limits.intermediate_buffer_size = most;
    limits.ifd_value_size = bytes.len();
    decoder = decoder.with_limits(limits);

    let colour = decoder.colortype().map_err(tiff_reason)?;
    let channels = match colour {
        tiff::ColorType::Gray(n) if n >= 8 => 1,
        tiff::ColorType::RGB(_) => 3,
        tiff::ColorType::RGBA(_) => 4,
        tiff::ColorType::Multiband { num_samples, .. } => {
            let extra: Vec<u16> =
                decoder.find_tag_unsigned_vec(Tag::ExtraSamples).map_err(tiff_reason)?.unwrap_or_default();
            // 1 and 2 are the two kinds of alpha.
            if num_samples != 2 || !matches!(extra[..], [1 | 2]) {
                return Err(format!("has {num_samples} bands; extract one, or red, green and blue"));
            }
            2
        }
        _ => return decode_coded(bytes, ImageFormat::Tiff, max_pixels),
    };

    let mut result = DecodingResult::U8(Vec::new());
    let layout = decoder.read_image_to_buffer(&mut result).map_err(tiff_reason)?;
    let samples = match result {
        DecodingResult::U8(v) => Samples::Byte(v.into()),
        DecodingResult::U16(v) => Samples::Word(v.into()),
        DecodingResult::F32(v) => Samples::Float(v.into()),
        DecodingResult::F64(v) => Samples::Double(v.into()),
        DecodingResult::F16(v) => Samples::Float(v.into_iter().map(f32::from).collect()),
        DecodingResult::I8(v) => Samples::Float(v.into_iter().map(f32::from).collect()),
        DecodingResult::I16(v) => Samples::Float(v.into_iter().map(f32::from).collect()),
        DecodingResult::I32(v) => Samples::Double(v.into_iter().map(f64::from).collect()),
        DecodingResult::U32(v) => Samples::Double(v.into_iter().map(f64::from).collect()),
        DecodingResult::U64(v) => Samples::Double(v.into_iter().map(|v| v as f64).collect()),
        DecodingResult::I64(v) => Samples::Double(v.into_iter().map(|v| v as f64).collect()),
    };
    let (width, height) = (width as usize, height as usize);
    let planar = layout.planes > 1;
    let samples = match samples {
        Samples::Byte(v) => {
            Samples::Byte(interleaved(v.into_owned(), width * height, channels, planar)?.into())
        }
        Samples::Word(v) => {
            Samples::Word(interleaved(v.into_owned(), width * height, channels, planar)?.into())
        }
        Samples::Float(v) => {
            Samples::Float(interleaved(v.into_owned(), width * height, channels, planar)?.into())
        }
        Samples::Double(v) => {
            Samples::Double(interleaved(v.into_owned(), width * height, channels, planar)?.into())
        }
    };
    Ok(Raster { width, height, channels, samples })
}

/// Errors where the first directory claims what the decoder believes before it looks: more values than the file has bytes, for
/// which it takes memory, and more planes and rows than it can count. What else is wrong with a directory the decoder finds.
fn check_tiff_directory(bytes: &[u8]) -> std::result::Result<(), String> {
    let big = bytes[2..4].contains(&43);
    let number = |at: usize, size: usize| {
        let field = bytes.get(at..at.checked_add(size)?)?;
        let append = |n: usize, byte: &u8| n << 8 | usize::from(*byte);
        Some(if bytes[0] == b'I' { field.iter().rev().fold(0, append) } else { field.iter().fold(0, append) })
    };
    // Sizes of places and counts, of the number of entries, and of an entry.
    let (wide, head, entry) = if big { (8, 8, 20) } else { (4, 2, 12) };
    let Some(start) = number(wide, wide) else { return Ok(()) };
    let entries = number(start, head).unwrap_or(0).min(bytes.len() / entry);
    let (mut rows, mut planes) = (1, 1);
    for i in 0..entries {
        let Some(at) = start.checked_add(head).and_then(|at| at.checked_add(i * entry)) else { break };
        let fields = (number(at, 2), number(at + 2, 2), number(at + 4, wide));
        let (Some(tag), Some(kind), Some(count)) = fields else { break };
        if count > bytes.len() {
            return Err(damaged(format!(
                "the TIFF directory claims {count} values in {} bytes",
                bytes.len()
            )));
        }
        let size = match kind {
            1 | 6 => 1,
            3 | 8 => 2,
            16..=18 => 8,
            _ => 4,
        };
        // What does not fit stands elsewhere.
        let place = at + 4 + wide;
        let place = if size > wide { number(place, wide).unwrap_or(usize::MAX) } else { place };
        let value = number(place, size).unwrap_or(0);
        match Tag::from_u16(tag as u16) {
            Some(Tag::ImageLength) => rows = rows.max(value),
            Some(Tag::SamplesPerPixel) => planes = planes.max(value),
            _ => {}
        }
    }
    if rows.checked_mul(planes).is_none_or(|strips| u32::try_from(strips).is_err()) {
        return Err(damaged(format!("the TIFF directory claims {planes} planes of {rows} rows")));
    }
    Ok(())
}

/// The samples with all channels of a pixel next to each other, from those or from one plane after the other.
fn interleaved<S: Copy>(
    samples: Vec<S>,
    pixels: usize,
    channels: usize,
    planar: bool,
) -> std::result::Result<Vec<S>, String> {
    // More planes than channels are bands that carry no colour.
    let enough = if planar { samples.len() >= pixels * channels } else { samples.len() == pixels * channels };
    if !enough {
        return Err(damaged("the TIFF data does not have the size that its header says"));
    }
    if !planar {
        return Ok(samples);
    }
    Ok((0..pixels).flat_map(|i| (0..channels).map(move |c| c * pixels + i)).map(|i| samples[i]).collect())
}
