//! Decodes image files: detects their kind from their first bytes, and reads their samples as stored.

use std::cell::Cell;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use image::{ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use super::file::{self, MAX_PIXELS_PER_BYTE, check_claim, check_size, damaged, max_bytes_of, unsupported};
use super::orientation::Orientation;
use super::raster::{Raster, Sample, Samples};
use super::{jpeg, npy, pfm, tiff};
use crate::error::{ReadError, Result};
use crate::memory::{self, Claim};
use crate::text::one_line;

/// Like [`MAX_PIXELS_PER_BYTE`], for uncompressed files, whose smallest pixel is one bit.
const MAX_PLAIN_PIXELS_PER_BYTE: u64 = 8;

/// The bytes of a file that begins like an image and is not too large for an image of `max_pixels` pixels.
pub(super) fn load(path: &Path, max_pixels: u64) -> Result<Vec<u8>> {
    file::load(path, max_pixels, |bytes| Kind::detect(bytes).is_none().then(|| unknown(bytes)))
}

/// The kind of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Pfm,
    Tiff,
    Npy,
    Npz,
    Coded(ImageFormat),
}

impl Kind {
    pub(super) fn detect(bytes: &[u8]) -> Option<Self> {
        if pfm::is_pfm(bytes) {
            return Some(Self::Pfm);
        }
        if npy::is_npy(bytes) {
            return Some(Self::Npy);
        }
        if npy::is_npz(bytes) {
            return Some(Self::Npz);
        }
        Some(match bytes {
            // A raw photograph, of which only the preview would be read.
            [b'I', b'I', 42, 0, _, _, _, _, b'C', b'R', ..] => return None,
            [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => Self::Tiff,
            [0x89, b'P', b'N', b'G', b'\r', b'\n', 0x1a, b'\n', ..] => Self::Coded(ImageFormat::Png),
            [0xff, 0xd8, 0xff, ..] => Self::Coded(ImageFormat::Jpeg),
            // The four bytes after the file size are reserved.
            [b'B', b'M', _, _, _, _, 0, 0, 0, 0, ..] => Self::Coded(ImageFormat::Bmp),
            [b'P', b'1'..=b'7', c, ..] if c.is_ascii_whitespace() || *c == b'#' => {
                Self::Coded(ImageFormat::Pnm)
            }
            _ => return None,
        })
    }
}

/// Unsupported kinds of files: offset, magic bytes, name, and remedy.
const FOREIGN: [(usize, &[u8], &str, &str); 35] = [
    (8, b"AVI ", "a film", FILM),
    (8, b"CR\x02", "a raw photograph", RAW),
    (8, b"WEBP", "a WebP image", PICTURE),
    (4, b"jP  \r\n\x87\n", "a JPEG 2000 image", PICTURE),
    (0, b"\xff\x4f\xff\x51", "a JPEG 2000 image", PICTURE),
    (4, b"JXL \r\n\x87\n", "a JPEG XL image", PICTURE),
    (0, b"\xff\x0a", "a JPEG XL image", PICTURE),
    (4, b"ftypavi", "an AVIF image", PICTURE),
    (4, b"ftyphei", "a HEIC image", PICTURE),
    (4, b"ftyphev", "a HEIC image", PICTURE),
    (4, b"ftypmif1", "a HEIC image", PICTURE),
    (4, b"ftypmsf1", "a HEIC image", PICTURE),
    (4, b"ftypcrx", "a raw photograph", RAW),
    (0, b"FUJIFILMCCD-RAW", "a raw photograph", RAW),
    (0, b"IIU\0", "a raw photograph", RAW),
    (0, b"IIRO", "a raw photograph", RAW),
    (0, b"IIRS", "a raw photograph", RAW),
    (0, b"FOVb", "a raw photograph", RAW),
    (0, b"GIF8", "a GIF image", PICTURE),
    (0, b"8BPS", "a Photoshop file", PICTURE),
    (0, b"DDS ", "a DDS texture", PICTURE),
    (0, b"qoif", "a QOI image", PICTURE),
    (0, b"\x76\x2f\x31\x01", "an OpenEXR image", FLOATS),
    (0, b"#?R", "a Radiance HDR image", FLOATS),
    (0, b"SIMPLE  =", "a FITS file", FLOATS),
    (0, b"\x89HDF", "an HDF5 file", FLOATS),
    (0, b"MATLAB", "a MATLAB file", FLOATS),
    (0, b"%PDF", "a PDF document", PICTURE),
    (0, b"\x1f\x8b", "a file packed by gzip", "unpack it with `gunzip`"),
    (0, b"\x28\xb5\x2f\xfd", "a file packed by Zstandard", "unpack it with `zstd -d`"),
    (4, b"ftyp", "a film", FILM),
    (0, b"\x1a\x45\xdf\xa3", "a film", FILM),
    (0, b"YUV4MPEG2", "a film", FILM),
    (0, b"\x89MCAP0", "a recording of ROS", FILM),
    (0, b"#ROSBAG", "a recording of ROS", FILM),
];
const PICTURE: &str = "convert it to PNG or JPEG";
const FLOATS: &str = "convert it to PFM, or to TIFF with floats";
const RAW: &str = "develop both views alike, to TIFF or PNG with 16 bits, without a correction of the lens";
const FILM: &str = "it is a sequence of frames, not one image";

/// The message for a file of an unknown kind.
fn unknown(bytes: &[u8]) -> String {
    let begins = |(at, magic, ..): &&(usize, &[u8], &str, &str)| {
        bytes.get(*at..).is_some_and(|rest| rest.starts_with(magic))
    };
    match FOREIGN.iter().find(begins) {
        Some((_, _, what, remedy)) => format!("is {what}, which is not supported: {remedy}"),
        None => "not an image of a known format; give PNG, JPEG, PNM, TIFF, BMP, PFM or NPY".into(),
    }
}

/// Decodes a whole file; the error is one line. Memory for pixels is allocated only if the header claims at
/// most `max_pixels`, and no more than the file can hold. Pixels whose samples are all `no_data` are marked;
/// without it, the no-data value of a TIFF file is used.
pub(super) fn decode(
    bytes: &[u8],
    max_pixels: u64,
    no_data: Option<f64>,
) -> Result<Raster<'static>, ReadError> {
    let marked = |raster: Raster<'static>| match no_data {
        Some(value) => Ok(raster.marked(value)?),
        None => Ok(raster),
    };
    guarded(|| match Kind::detect(bytes) {
        Some(Kind::Pfm) => decode_pfm(bytes, max_pixels).and_then(marked),
        Some(Kind::Tiff) => tiff::decode(bytes, max_pixels, no_data),
        Some(Kind::Npy) => npy::decode(bytes, max_pixels).and_then(marked),
        Some(Kind::Npz) => npy::decode_archive(bytes, max_pixels).and_then(marked),
        Some(Kind::Coded(ImageFormat::Jpeg)) => jpeg::decode(bytes, max_pixels).and_then(marked),
        Some(Kind::Coded(format)) => decode_coded(bytes, format, max_pixels).and_then(marked),
        None => Err(unknown(bytes).into()),
    })
}

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Whether this thread is decoding an image. A panic is then caught and becomes an error, so a panic hook may
/// ignore it.
#[must_use]
pub fn is_guarded() -> bool {
    GUARDED.get()
}

/// Runs a foreign decoder, and turns its panics into errors of the file.
pub(super) fn guarded<T>(decode: impl FnOnce() -> Result<T, ReadError>) -> Result<T, ReadError> {
    let before = GUARDED.replace(true);
    let decoded = catch_unwind(AssertUnwindSafe(decode));
    GUARDED.set(before);
    decoded.unwrap_or_else(|panic| {
        let text = panic
            .downcast_ref::<&str>()
            .copied()
            .or_else(|| panic.downcast_ref::<String>().map(String::as_str));
        Err(unsupported(format!("the decoder gave up: {}", one_line(text.unwrap_or("for no known reason")))))
    })
}

fn decode_pfm(bytes: &[u8], max_pixels: u64) -> Result<Raster<'static>, ReadError> {
    let (size, channels, samples) = match pfm::decode(bytes, max_pixels)? {
        pfm::Pfm::Grey(p) => (p.size(), 1, p.into_data()),
        pfm::Pfm::Colour(p) => (p.size(), 3, p.into_data().into_flattened()),
    };
    Ok(Raster::of(size, channels, Samples::Float(samples.into())))
}

/// The error of the general decoder.
fn coded_reason(e: ImageError) -> ReadError {
    let text = plain(&e.to_string());
    if matches!(e, ImageError::Unsupported(_)) { unsupported(text) } else { damaged(text) }
}

/// The text of an error, with the names of PNG chunks in place of the structures that the decoder prints.
fn plain(text: &str) -> String {
    const BEGIN: &str = "ChunkType { type: ";
    let mut parts = text.split(BEGIN);
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (name, rest) = part.split_once(',').unwrap_or((part, ""));
        out += name;
        out += rest.split_once('}').map_or("", |(_, rest)| rest);
    }
    out
}

/// (width, height) as stored, and the orientation.
#[cfg(not(target_arch = "wasm32"))]
pub(super) type Turned = ((usize, usize), Orientation);

/// (width, height) and orientation of a file of `length` bytes, of which `bytes` are the first: of the image as
/// stored, by its header alone. `None` for a kind whose header is packed or elsewhere.
#[cfg(not(target_arch = "wasm32"))]
pub(super) fn size(bytes: &[u8], max_pixels: u64, length: u64) -> Result<Option<Turned>, ReadError> {
    let upright = |size| Some((size, Orientation::UPRIGHT));
    guarded(|| match Kind::detect(bytes) {
        Some(Kind::Pfm) => Ok(upright(pfm::size(bytes, max_pixels)?.0)),
        Some(Kind::Npy) => Ok(upright(npy::size(bytes, max_pixels)?)),
        Some(Kind::Coded(ImageFormat::Jpeg)) => jpeg::size(bytes, max_pixels, length).map(Some),
        Some(Kind::Coded(format)) => {
            let mut decoder = decoder(bytes, format, max_pixels, length)?;
            let (width, height) = decoder.dimensions();
            Ok(Some(((width as usize, height as usize), orientation(&mut decoder))))
        }
        Some(Kind::Npz | Kind::Tiff) => Ok(None),
        None => Err(unknown(bytes).into()),
    })
}

/// The decoder of a file of `length` bytes, whose size is checked.
fn decoder(
    bytes: &[u8],
    format: ImageFormat,
    max_pixels: u64,
    length: u64,
) -> Result<impl ImageDecoder, ReadError> {
    // The decoder unpacks other compressed data of a PNG file before it reports the size.
    let claimed = if format == ImageFormat::Png {
        let (width, height) = png_size(bytes)?;
        check_size(width, height, max_pixels)?;
        width * height
    } else {
        max_pixels
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(max_bytes_of(claimed));
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(coded_reason)?;
    let (width, height) = decoder.dimensions();
    let plain = format == ImageFormat::Pnm;
    let per_byte = if plain { MAX_PLAIN_PIXELS_PER_BYTE } else { MAX_PIXELS_PER_BYTE };
    check_claim((width.into(), height.into()), max_pixels, per_byte, length)?;
    Ok(decoder)
}

fn decode_coded(bytes: &[u8], format: ImageFormat, max_pixels: u64) -> Result<Raster<'static>, ReadError> {
    let mut decoder = decoder(bytes, format, max_pixels, bytes.len() as u64)?;
    let (width, height) = decoder.dimensions();
    // The decoder holds rows and their filtered copies in addition to its pixels.
    let _claim = Claim::new(2 * decoder.total_bytes())?;
    let orientation = orientation(&mut decoder);
    let (colour, size) = (decoder.color_type(), (width as usize, height as usize));
    let channels = usize::from(colour.channel_count());
    let samples = match usize::from(colour.bytes_per_pixel()) / channels {
        1 => filled::<u8>(decoder)?,
        2 => filled::<u16>(decoder)?,
        _ => filled::<f32>(decoder)?,
    };
    Ok(Raster { orientation, ..Raster::of(size, channels, samples) })
}

/// The orientation in the EXIF data of an image.
fn orientation(decoder: &mut impl ImageDecoder) -> Orientation {
    // Ignore damaged EXIF data, which does not affect the pixels.
    let exif = decoder.exif_metadata().ok().flatten();
    exif.map_or(Orientation::UPRIGHT, |data| Orientation::of_exif(&data))
}

/// Reads all samples, as values of this type.
fn filled<S: Sample + bytemuck::Pod>(decoder: impl ImageDecoder) -> Result<Samples<'static>, ReadError> {
    let bytes = usize::try_from(decoder.total_bytes()).unwrap_or(usize::MAX);
    let mut samples = memory::filled(bytes / size_of::<S>(), S::zeroed())?;
    decoder.read_image(bytemuck::cast_slice_mut(&mut samples)).map_err(coded_reason)?;
    Ok(S::samples(samples.into()))
}

/// (width, height) that a PNG file claims, from the header that must come first.
fn png_size(bytes: &[u8]) -> Result<(u64, u64), ReadError> {
    match bytes.get(8..24) {
        Some([0, 0, 0, 13, b'I', b'H', b'D', b'R', a, b, c, d, e, f, g, h]) => {
            Ok((u32::from_be_bytes([*a, *b, *c, *d]).into(), u32::from_be_bytes([*e, *f, *g, *h]).into()))
        }
        _ => Err(damaged("the PNG file does not begin with its header")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decoder_that_panics_is_an_error_of_the_file() {
        let nothing: Vec<u8> = Vec::new();
        let said = guarded(|| {
            assert!(is_guarded());
            Ok(nothing[0])
        });
        let said = said.unwrap_err().to_string();
        assert!(
            said.contains("the decoder gave up: index out of bounds") && said.contains("convert it"),
            "{said}"
        );
        assert!(!is_guarded());
        assert_eq!(guarded(|| Ok(1)), Ok(1));
        assert_eq!(guarded(|| Err::<(), _>("told".into())), Err("told".into()));
    }

    /// Each foreign file is named with a remedy, and none of them is mistaken for a supported kind.
    #[test]
    fn foreign_files_are_named() {
        for (at, magic, what, remedy) in FOREIGN {
            let bytes = [&vec![0; at][..], magic, &[0; 64]].concat();
            assert_eq!(Kind::detect(&bytes), None, "{what}");
            assert_eq!(unknown(&bytes), format!("is {what}, which is not supported: {remedy}"));
        }
        assert!(
            unknown(b"RIFF\0\0\0\0WEBPVP8 ")
                .contains("is a WebP image, which is not supported: convert it to PNG")
        );
        assert!(unknown(b"hello").contains("known format; give PNG"));
    }

    #[test]
    fn the_names_of_chunks_are_plain() {
        let text = "CRC error while decoding ChunkType { type: IDAT, critical: true, private: false } chunk.";
        assert_eq!(plain(text), "CRC error while decoding IDAT chunk.");
        assert_eq!(plain("nothing of the kind"), "nothing of the kind");
        assert_eq!(plain("ChunkType { type: IDAT"), "IDAT");
    }
}
