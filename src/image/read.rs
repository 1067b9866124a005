//! Reading pairs, masks and disparity maps.
//!
//! What a file is follows from its first bytes, never from its name.

use std::fs::{self, File};
use std::io::{Cursor, Read};
use std::path::Path;

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::Tag;

use super::{Image, Pair, Pixel, Plane, grey, pfm};
use crate::error::{Error, Result};

/// The most pixels that one image may have.
pub const MAX_PIXELS: u64 = 1 << 30;

/// The most bytes that one file may have: four channels of the widest kind for every pixel.
const MAX_BYTES: u64 = 32 * MAX_PIXELS;

/// No codec here packs more pixels than this into a byte; a header that claims more lies, and believing it
/// would cost memory in vain.
const MAX_PIXELS_PER_BYTE: u64 = 10_000;

/// Float values and the wider integers end here: 255 in 1/256 of an 8-bit level.
const LINEAR_TOP: f64 = 65280.0;

/// Reads a rectified pair from PNG, JPEG, PNM, TIFF or PFM files, told apart by their content.
///
/// Values become 1/256 of an 8-bit level:
///
/// - 8 bits: times 256;
/// - 16 bits: shifted up by as many bits as the largest unmasked value of both images leaves free (at most 8),
///   so that an 11-bit pair uses the whole range. Where all values are multiples of 257, they are 8-bit values
///   stretched to 16 bits, and give the same picture as those. An 8-bit image that comes with a 16-bit one is
///   stretched first;
/// - float, signed, or wider than 16 bits: linearly, from the least to the largest unmasked value of both images
///   to 0 ..= 65280.
///
/// Masked are pixels with alpha 0, and with a value that is not finite. `mask` is an image of the size of the
/// left one; where it is not black, the left image is masked as well. A masked pixel holds zeros.
///
/// # Errors
/// [`Error::Read`] when a file is missing, damaged, too large (more than [`MAX_PIXELS`]) or of an unknown kind;
/// [`Error::Mismatch`] when the sizes differ, or only one of the images has float values.
pub fn pair(left: &Path, right: &Path, mask: Option<&Path>) -> Result<Pair> {
    let images = [raster(left)?, raster(right)?];
    let [l, r] = &images;
    if l.size() != r.size() {
        return Err(Error::Mismatch(format!(
            "{} is {} x {} and {} is {} x {}: a rectified pair has one size",
            left.display(),
            l.width,
            l.height,
            right.display(),
            r.width,
            r.height
        )));
    }
    if l.samples.is_float() != r.samples.is_float() {
        let (float, whole) = if l.samples.is_float() { (left, right) } else { (right, left) };
        return Err(Error::Mismatch(format!(
            "{} holds float values and {} whole ones: give both in one format",
            float.display(),
            whole.display()
        )));
    }
    let mut masks = [l.masked(), r.masked()];
    if let Some(path) = mask {
        let ignored = self::mask(path)?;
        if ignored.size() != l.size() {
            return Err(Error::Mismatch(format!(
                "the mask {} is {} x {} and {} is {} x {}: a mask has the size of the left image",
                path.display(),
                ignored.width(),
                ignored.height(),
                left.display(),
                l.width,
                l.height
            )));
        }
        for (masked, ignored) in masks[0].data_mut().iter_mut().zip(ignored.data()) {
            *masked |= ignored;
        }
    }
    let scale = Scale::of(&images, &masks);
    let [l, r] = images;
    let [lm, rm] = masks;
    let left = scale.apply(&l, lm);
    drop(l);
    Pair::new(left, scale.apply(&r, rm))
}

/// Reads a mask from any image that [`pair`] reads: `true` where a pixel is not black (alpha does not count).
///
/// # Errors
/// [`Error::Read`] as [`pair`].
pub fn mask(path: &Path) -> Result<Plane<bool>> {
    let raster = raster(path)?;
    let plane = match &raster.samples {
        Samples::Byte(v) => raster.plane(v, |c| c.iter().any(|&v| v != 0)),
        Samples::Word(v) => raster.plane(v, |c| c.iter().any(|&v| v != 0)),
        Samples::Float(v) => raster.plane(v, |c| c.iter().any(|&v| v != 0.0)),
        Samples::Double(v) => raster.plane(v, |c| c.iter().any(|&v| v != 0.0)),
    };
    Ok(plane)
}

/// Reads 8-bit levels, such as those of Middlebury's visibility masks, from any integer image that [`pair`] reads:
/// of 16 bits the upper 8, of colours the grey.
///
/// # Errors
/// [`Error::Read`] as [`pair`], and for float values.
pub fn grey8(path: &Path) -> Result<Plane<u8>> {
    let raster = raster(path)?;
    let level = |c: &[u16]| match c {
        [r, g, b] => (grey(*r, *g, *b) >> 8) as u8,
        [v, ..] => (v >> 8) as u8,
        [] => 0,
    };
    match &raster.samples {
        Samples::Byte(v) => {
            let wide: Vec<u16> = v.iter().map(|&v| u16::from(v) << 8).collect();
            Ok(raster.plane(&wide, level))
        }
        Samples::Word(v) => Ok(raster.plane(v, level)),
        Samples::Float(_) | Samples::Double(_) => {
            Err(Error::read(path, "holds float values; give an 8-bit PNG"))
        }
    }
}

/// Reads a disparity map in pixels; what is invalid becomes +infinity. PFM and float TIFF hold disparities as
/// they are (not finite: invalid), 16-bit PNG holds them times 256 (0: invalid).
///
/// # Errors
/// [`Error::Read`] when the file is missing, damaged, or holds no disparities in one of these ways.
pub fn read_disparity(path: &Path) -> Result<Plane<f32>> {
    const REMEDY: &str = "disparity maps are .pfm, float .tif, or 16-bit .png with disparity times 256";
    let bytes = load(path)?;
    let kind = Kind::of(&bytes);
    let raster = decode(&bytes).map_err(|reason| Error::read(path, reason))?;
    drop(bytes);
    let wrong = |what: &str| Err(Error::read(path, format!("{what}; {REMEDY}")));
    if raster.channels != 1 {
        return wrong("has more than one channel");
    }
    let valid = |d: f32| if d.is_finite() { d } else { f32::INFINITY };
    let values: Vec<f32> = match (kind, raster.samples) {
        (Some(Kind::Pfm | Kind::Tiff), Samples::Float(v)) => v.into_iter().map(valid).collect(),
        (Some(Kind::Tiff), Samples::Double(v)) => v.into_iter().map(|d| valid(d as f32)).collect(),
        (Some(Kind::Coded(ImageFormat::Png)), Samples::Word(v)) => {
            v.into_iter().map(|v| if v == 0 { f32::INFINITY } else { v as f32 / 256.0 }).collect()
        }
        (Some(Kind::Coded(ImageFormat::Png)), _) => {
            return wrong("an 8-bit PNG does not tell the scale of its disparities");
        }
        _ => return wrong("holds no disparities"),
    };
    Ok(Plane::new(raster.width, raster.height, values))
}

/// The bytes of a file that begins like an image.
pub(super) fn load(path: &Path) -> Result<Vec<u8>> {
    let error = |reason: &str| Err(Error::read(path, reason));
    let io = |e: std::io::Error| match e.kind() {
        std::io::ErrorKind::NotFound => Error::read(path, "there is no such file; check the name"),
        _ => Error::read(path, e),
    };
    let metadata = fs::metadata(path).map_err(io)?;
    if metadata.is_dir() {
        return error("is a folder; give the image file");
    }
    if metadata.len() > MAX_BYTES {
        return error("too large for an image; crop or tile it");
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
    file.take(MAX_BYTES).read_to_end(&mut bytes).map_err(io)?;
    Ok(bytes)
}

/// Errors when an image of this size will not be read.
pub(super) fn check_size(width: u64, height: u64) -> std::result::Result<(), String> {
    if width == 0 || height == 0 {
        return Err(format!("is {width} x {height} and holds no pixel"));
    }
    if width.checked_mul(height).is_none_or(|n| n > MAX_PIXELS) {
        return Err(format!(
            "claims {width} x {height} pixels and at most {MAX_PIXELS} are read; crop or tile it, if that is true"
        ));
    }
    Ok(())
}

/// As [`check_size`], for formats that compress.
fn check_claim(width: u64, height: u64, bytes: &[u8]) -> std::result::Result<(), String> {
    check_size(width, height)?;
    if width * height > MAX_PIXELS_PER_BYTE * bytes.len() as u64 {
        return Err(format!(
            "claims {width} x {height} pixels in {} bytes: truncated or damaged; get the file again",
            bytes.len()
        ));
    }
    Ok(())
}

/// What a file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Pfm,
    Tiff,
    Coded(ImageFormat),
}

impl Kind {
    fn of(bytes: &[u8]) -> Option<Self> {
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

/// Samples as a file holds them, all channels of a pixel next to each other.
enum Samples {
    Byte(Vec<u8>),
    Word(Vec<u16>),
    Float(Vec<f32>),
    /// Also the integers that do not fit a word.
    Double(Vec<f64>),
}

impl Samples {
    fn is_float(&self) -> bool {
        matches!(self, Self::Float(_) | Self::Double(_))
    }
}

/// An image as a file holds it.
struct Raster {
    width: usize,
    height: usize,
    /// 1 grey, 2 grey and alpha, 3 colour, 4 colour and alpha.
    channels: usize,
    samples: Samples,
}

impl Raster {
    fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// `f` of the grey or colour samples of each pixel.
    fn plane<S, T>(&self, samples: &[S], f: impl Fn(&[S]) -> T) -> Plane<T> {
        let colours = if self.channels < 3 { 1 } else { 3 };
        let values = samples.chunks_exact(self.channels).map(|pixel| f(&pixel[..colours])).collect();
        Plane::new(self.width, self.height, values)
    }

    /// `true` where alpha is 0 or a value is not finite.
    fn masked(&self) -> Plane<bool> {
        fn masked<S: Copy>(
            raster: &Raster,
            samples: &[S],
            clear: impl Fn(S) -> bool,
            ok: impl Fn(S) -> bool,
        ) -> Plane<bool> {
            let n = raster.channels;
            let colours = if n < 3 { 1 } else { 3 };
            let pixel = |p: &[S]| (n > colours && clear(p[colours])) || !p[..colours].iter().all(|&v| ok(v));
            Plane::new(raster.width, raster.height, samples.chunks_exact(n).map(pixel).collect())
        }
        match &self.samples {
            Samples::Byte(v) => masked(self, v, |a| a == 0, |_| true),
            Samples::Word(v) => masked(self, v, |a| a == 0, |_| true),
            Samples::Float(v) => masked(self, v, |a| a == 0.0, f32::is_finite),
            Samples::Double(v) => masked(self, v, |a| a == 0.0, f64::is_finite),
        }
    }

    /// Calls `f` with the grey or colour samples of every pixel that is not masked.
    fn each<S: Copy>(&self, samples: &[S], masked: &Plane<bool>, mut f: impl FnMut(S)) {
        let colours = if self.channels < 3 { 1 } else { 3 };
        for (pixel, _) in samples.chunks_exact(self.channels).zip(masked.data()).filter(|(_, m)| !**m) {
            pixel[..colours].iter().for_each(|&v| f(v));
        }
    }

    fn each_word(&self, masked: &Plane<bool>, f: impl FnMut(u16)) {
        match &self.samples {
            Samples::Byte(v) => {
                let mut f = f;
                self.each(v, masked, |v| f(stretched(v)));
            }
            Samples::Word(v) => self.each(v, masked, f),
            Samples::Float(_) | Samples::Double(_) => {}
        }
    }

    fn each_double(&self, masked: &Plane<bool>, mut f: impl FnMut(f64)) {
        match &self.samples {
            Samples::Float(v) => self.each(v, masked, |v| f(v as f64)),
            Samples::Double(v) => self.each(v, masked, f),
            Samples::Byte(_) | Samples::Word(_) => {}
        }
    }
}

/// An 8-bit level on the 16-bit scale.
fn stretched(v: u8) -> u16 {
    v as u16 * 257
}

/// From samples to levels, the same for both images of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Scale {
    /// 8-bit levels, stored as they are or times 257.
    Level,
    /// Words with this many free bits at the top.
    Shift(u32),
    /// Floats between these bounds.
    Linear { min: f64, max: f64 },
}

impl Scale {
    /// The scale that what is not masked asks for.
    fn of(images: &[Raster; 2], masks: &[Plane<bool>; 2]) -> Self {
        let each = || images.iter().zip(masks);
        if images[0].samples.is_float() {
            let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
            each().for_each(|(i, m)| {
                i.each_double(m, |v| {
                    min = min.min(v);
                    max = max.max(v);
                });
            });
            return Self::Linear { min, max };
        }
        if each().all(|(i, _)| matches!(i.samples, Samples::Byte(_))) {
            return Self::Level;
        }
        let (mut bits, mut levels) = (0, true);
        each().for_each(|(i, m)| {
            i.each_word(m, |v| {
                bits |= v;
                levels &= v.is_multiple_of(257);
            });
        });
        if levels { Self::Level } else { Self::Shift(bits.leading_zeros().min(8)) }
    }

    fn apply(self, raster: &Raster, masked: Plane<bool>) -> Image {
        let n = raster.channels;
        let pixels = match &raster.samples {
            Samples::Byte(v) => pixels(v, n, &masked, |v| self.word(stretched(v))),
            Samples::Word(v) => pixels(v, n, &masked, |v| self.word(v)),
            Samples::Float(v) => pixels(v, n, &masked, |v| self.double(v as f64)),
            Samples::Double(v) => pixels(v, n, &masked, |v| self.double(v)),
        };
        Image { pixels, masked }
    }

    fn word(self, v: u16) -> u16 {
        match self {
            Self::Shift(free) => v << free,
            Self::Level | Self::Linear { .. } => (v / 257) << 8,
        }
    }

    fn double(self, v: f64) -> u16 {
        match self {
            // Halves, for the difference of two doubles may be none.
            Self::Linear { min, max } if max > min => {
                ((v / 2.0 - min / 2.0) / (max / 2.0 - min / 2.0) * LINEAR_TOP).round() as u16
            }
            _ => 0,
        }
    }
}

/// Pixels from samples of `n` channels; what is masked becomes zero, whatever it was.
fn pixels<S: Copy>(samples: &[S], n: usize, masked: &Plane<bool>, level: impl Fn(S) -> u16) -> Plane<Pixel> {
    let pixel = |(p, masked): (&[S], &bool)| match p {
        _ if *masked => [0; 4],
        [r, g, b, ..] => {
            let [r, g, b] = [*r, *g, *b].map(&level);
            [r, g, b, grey(r, g, b)]
        }
        [v, ..] => [level(*v); 4],
        [] => [0; 4],
    };
    let values = samples.chunks_exact(n).zip(masked.data()).map(pixel).collect();
    Plane::new(masked.width(), masked.height(), values)
}

fn raster(path: &Path) -> Result<Raster> {
    decode(&load(path)?).map_err(|reason| Error::read(path, reason))
}

/// Decodes a whole file; the error says in one line what is wrong with it.
fn decode(bytes: &[u8]) -> std::result::Result<Raster, String> {
    let raster = match Kind::of(bytes) {
        Some(Kind::Pfm) => decode_pfm(bytes),
        Some(Kind::Tiff) => decode_tiff(bytes),
        Some(Kind::Coded(format)) => decode_coded(bytes, format),
        None => Err(unknown(bytes)),
    };
    raster.map_err(|reason| reason.split_whitespace().collect::<Vec<_>>().join(" "))
}

fn decode_pfm(bytes: &[u8]) -> std::result::Result<Raster, String> {
    let (width, height, channels, samples) = match pfm::decode(bytes)? {
        pfm::Pfm::Grey(p) => (p.width(), p.height(), 1, p.into_data()),
        pfm::Pfm::Colour(p) => (p.width(), p.height(), 3, p.into_data().into_flattened()),
    };
    Ok(Raster { width, height, channels, samples: Samples::Float(samples) })
}

/// The decoder's error with what to do about it.
fn damaged(e: impl std::fmt::Display) -> String {
    format!("{e}; truncated or damaged? get the file again, or convert it to PNG")
}

fn decode_coded(bytes: &[u8], format: ImageFormat) -> std::result::Result<Raster, String> {
    // The decoder fills up what is missing of a JPEG file with grey and says nothing.
    if format == ImageFormat::Jpeg && !jpeg_is_whole(bytes) {
        return Err(damaged("the JPEG data has no end"));
    }
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    check_claim(width as u64, height as u64, bytes)?;
    let image = DynamicImage::from_decoder(decoder).map_err(damaged)?;
    let (channels, samples) = match image {
        DynamicImage::ImageLuma8(i) => (1, Samples::Byte(i.into_raw())),
        DynamicImage::ImageLumaA8(i) => (2, Samples::Byte(i.into_raw())),
        DynamicImage::ImageRgb8(i) => (3, Samples::Byte(i.into_raw())),
        DynamicImage::ImageRgba8(i) => (4, Samples::Byte(i.into_raw())),
        DynamicImage::ImageLuma16(i) => (1, Samples::Word(i.into_raw())),
        DynamicImage::ImageLumaA16(i) => (2, Samples::Word(i.into_raw())),
        DynamicImage::ImageRgb16(i) => (3, Samples::Word(i.into_raw())),
        DynamicImage::ImageRgba16(i) => (4, Samples::Word(i.into_raw())),
        DynamicImage::ImageRgb32F(i) => (3, Samples::Float(i.into_raw())),
        DynamicImage::ImageRgba32F(i) => (4, Samples::Float(i.into_raw())),
        other => {
            return Err(format!("pixels of the kind {:?} are not read; convert it to PNG", other.color()));
        }
    };
    Ok(Raster { width: width as usize, height: height as usize, channels, samples })
}

/// Whether the last scan of a JPEG file is followed by an end mark. Within a scan, 0xff 0xd9 cannot occur.
fn jpeg_is_whole(bytes: &[u8]) -> bool {
    let last = |mark: u8| bytes.windows(2).rposition(|w| w == [0xff, mark]);
    matches!((last(0xda), last(0xd9)), (Some(scan), Some(end)) if end > scan)
}

/// Integer and float TIFF. What is packed into less than a byte, or is neither grey nor RGB, is left to the
/// general decoder.
fn decode_tiff(bytes: &[u8]) -> std::result::Result<Raster, String> {
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(damaged)?;
    let (width, height) = decoder.dimensions().map_err(damaged)?;
    check_claim(width as u64, height as u64, bytes)?;
    // Sixteen samples of the widest kind for a pixel, and room for a strip of a small picture.
    let most = width as usize * height as usize * 128 + (1 << 26);
    let mut limits = tiff::decoder::Limits::unlimited();
    limits.decoding_buffer_size = most;
    limits.intermediate_buffer_size = most;
    limits.ifd_value_size = bytes.len();
    decoder = decoder.with_limits(limits);

    let colour = decoder.colortype().map_err(damaged)?;
    let channels = match colour {
        tiff::ColorType::Gray(n) if n >= 8 => 1,
        tiff::ColorType::RGB(_) => 3,
        tiff::ColorType::RGBA(_) => 4,
        tiff::ColorType::Multiband { num_samples, .. } => {
            let extra: Vec<u16> =
                decoder.find_tag_unsigned_vec(Tag::ExtraSamples).map_err(damaged)?.unwrap_or_default();
            // 1 and 2 are the two kinds of alpha.
            if num_samples != 2 || !matches!(extra[..], [1 | 2]) {
                return Err(format!("has {num_samples} bands; extract one, or red, green and blue"));
            }
            2
        }
        _ => return decode_coded(bytes, ImageFormat::Tiff),
    };

    let mut result = DecodingResult::U8(Vec::new());
    let layout = decoder.read_image_to_buffer(&mut result).map_err(damaged)?;
    let samples = match result {
        DecodingResult::U8(v) => Samples::Byte(v),
        DecodingResult::U16(v) => Samples::Word(v),
        DecodingResult::F32(v) => Samples::Float(v),
        DecodingResult::F64(v) => Samples::Double(v),
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
        Samples::Byte(v) => Samples::Byte(interleaved(v, width * height, channels, planar)?),
        Samples::Word(v) => Samples::Word(interleaved(v, width * height, channels, planar)?),
        Samples::Float(v) => Samples::Float(interleaved(v, width * height, channels, planar)?),
        Samples::Double(v) => Samples::Double(interleaved(v, width * height, channels, planar)?),
    };
    Ok(Raster { width, height, channels, samples })
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

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use image::{GrayAlphaImage, GrayImage, ImageBuffer, Luma, LumaA, Rgb, RgbImage, Rgba, RgbaImage};
    use tempfile::TempDir;
    use tiff::encoder::{TiffEncoder, colortype};
    use tiff::tags::ExtraSamples;

    use super::*;

    const W: u32 = 4;
    const H: u32 = 3;
    const N: usize = 12;

    /// A folder for the files of one test.
    struct Folder(TempDir);

    impl Folder {
        fn new() -> Self {
            Self(tempfile::tempdir().unwrap())
        }

        fn at(&self, name: &str) -> PathBuf {
            self.0.path().join(name)
        }

        fn bytes(&self, name: &str, bytes: &[u8]) -> PathBuf {
            fs::write(self.at(name), bytes).unwrap();
            self.at(name)
        }

        fn grey8(&self, name: &str, values: [u8; N]) -> PathBuf {
            GrayImage::from_raw(W, H, values.to_vec()).unwrap().save(self.at(name)).unwrap();
            self.at(name)
        }

        fn grey16(&self, name: &str, values: [u16; N]) -> PathBuf {
            ImageBuffer::<Luma<u16>, _>::from_raw(W, H, values.to_vec())
                .unwrap()
                .save(self.at(name))
                .unwrap();
            self.at(name)
        }

        fn tiff<C: colortype::ColorType>(&self, name: &str, values: &[C::Inner]) -> PathBuf
        where
            [C::Inner]: tiff::encoder::TiffValue,
        {
            let mut bytes = Cursor::new(Vec::new());
            TiffEncoder::new(&mut bytes).unwrap().write_image::<C>(W, H, values).unwrap();
            self.bytes(name, bytes.get_ref())
        }
    }

    fn greys(image: &Image) -> Vec<u16> {
        assert!(image.pixels.data().iter().all(|[r, g, b, v]| r == v && g == v && b == v));
        image.pixels.data().iter().map(|p| p[3]).collect()
    }

    fn masked(image: &Image) -> Vec<usize> {
        let masked: Vec<usize> = (0..N).filter(|&i| image.masked.data()[i]).collect();
        assert!(masked.iter().all(|&i| image.pixels.data()[i] == [0; 4]), "masked pixels hold zeros");
        masked
    }

    fn refused<T: std::fmt::Debug>(result: Result<T>, words: &[&str]) {
        let error = result.unwrap_err().to_string();
        assert!(words.iter().all(|w| error.contains(w)), "{words:?} in: {error}");
        assert!(!error.contains('\n'), "one line: {error}");
    }

    const RAMP: [u8; N] = [0, 1, 2, 3, 50, 99, 100, 127, 128, 200, 254, 255];

    #[test]
    fn eight_bits_are_shifted() {
        let f = Folder::new();
        let left = f.grey8("l.png", RAMP);
        let right = f.grey8("r.tif", RAMP.map(|v| 255 - v));
        let pair = pair(&left, &right, None).unwrap();
        assert_eq!(greys(pair.left()), RAMP.map(|v| (v as u16) << 8));
        assert_eq!(greys(pair.right()), RAMP.map(|v| ((255 - v) as u16) << 8));
        assert!(masked(pair.left()).is_empty() && masked(pair.right()).is_empty());
    }

    #[test]
    fn colour_agrees_with_the_crates_grey() {
        let f = Folder::new();
        let rgb = Plane::from_fn(W as usize, H as usize, |x, y| [x as u8 * 60, y as u8 * 90, 255 - x as u8]);
        for name in ["a.png", "a.ppm", "a.tif"] {
            RgbImage::from_raw(W, H, rgb.data().as_flattened().to_vec()).unwrap().save(f.at(name)).unwrap();
            let pair = pair(&f.at(name), &f.at(name), None).unwrap();
            assert_eq!(*pair.left(), Image::from_rgb8(&rgb), "{name}");
            assert_eq!(pair.left(), pair.right());
        }
    }

    #[test]
    fn an_8_bit_pair_times_257_is_the_same_pair() {
        let f = Folder::new();
        // A dark pair too: the free bits of its largest value must not brighten it.
        for values in [RAMP, RAMP.map(|v| v / 9)] {
            let byte = f.grey8("byte.png", values);
            let word = f.grey16("word.png", values.map(stretched));
            let expected = pair(&byte, &byte, None).unwrap();
            assert_eq!(pair(&word, &word, None).unwrap(), expected);
            assert_eq!(pair(&byte, &word, None).unwrap(), expected);
            assert_eq!(pair(&word, &byte, None).unwrap(), expected);
        }
        // Negative control: 256 is no stretching, and one more is another picture.
        let byte = f.grey8("byte.png", RAMP);
        let mut values = RAMP.map(stretched);
        values[4] += 1;
        let word = f.grey16("word.png", values);
        assert_ne!(pair(&word, &word, None).unwrap(), pair(&byte, &byte, None).unwrap());
    }

    #[test]
    fn words_use_the_whole_range() {
        let f = Folder::new();
        let values = |max: u16| -> [u16; N] { std::array::from_fn(|i| (max as usize * i / (N - 1)) as u16) };
        for (max, free) in
            [(65535, 0), (40000, 0), (32767, 1), (2047, 5), (1024, 5), (1023, 6), (200, 8), (3, 8)]
        {
            let path = f.grey16("a.png", values(max));
            let same = pair(&path, &path, None).unwrap();
            assert_eq!(greys(same.left()), values(max).map(|v| v << free), "{max}");
            // The brighter of the two decides for both.
            let dim = f.grey16("b.tif", values(max / 5));
            for pair in [pair(&dim, &path, None).unwrap(), pair(&path, &dim, None).unwrap()] {
                let (l, r) = (greys(pair.left()), greys(pair.right()));
                let [low, high] = if l[N - 1] < r[N - 1] { [l, r] } else { [r, l] };
                assert_eq!(low, values(max / 5).map(|v| v << free), "{max}");
                assert_eq!(high, values(max).map(|v| v << free), "{max}");
            }
        }
    }

    #[test]
    fn an_8_bit_image_with_a_16_bit_one_is_stretched() {
        let f = Folder::new();
        let byte = f.grey8("l.png", RAMP);
        let word = f.grey16("r.png", RAMP.map(|v| v as u16 * 200));
        let pair = pair(&byte, &word, None).unwrap();
        assert_eq!(greys(pair.left()), RAMP.map(stretched));
        assert_eq!(greys(pair.right()), RAMP.map(|v| v as u16 * 200));
    }

    #[test]
    fn what_is_masked_influences_nothing() {
        let f = Folder::new();
        let mask = f.grey8("mask.png", [0, 0, 255, 0, 0, 0, 0, 1, 0, 0, 0, 0]);
        let right = f.grey16("r.png", std::array::from_fn(|i| 100 * i as u16));
        let mut results = Vec::new();
        for wild in [0, 1, 1500, 65535] {
            let mut values = std::array::from_fn(|i| 101 * i as u16);
            (values[2], values[7]) = (wild, wild);
            let pair = pair(&f.grey16("l.png", values), &right, Some(&mask)).unwrap();
            assert_eq!(masked(pair.left()), [2, 7]);
            assert!(masked(pair.right()).is_empty());
            results.push(pair);
        }
        assert!(results.iter().all(|r| *r == results[0]));
        // Negative control: without the mask they differ.
        assert_ne!(pair(&f.at("l.png"), &right, None).unwrap(), results[0]);

        let mut floats = Vec::new();
        let right = f.tiff::<colortype::Gray32Float>("r.tif", &[5.0; N]);
        for wild in [0.0, -1e30, f32::MAX, f32::NAN] {
            let mut values: [f32; N] = std::array::from_fn(|i| i as f32);
            (values[2], values[7]) = (wild, wild);
            let left = f.tiff::<colortype::Gray32Float>("l.tif", &values);
            floats.push(pair(&left, &right, Some(&mask)).unwrap());
        }
        assert!(floats.iter().all(|r| *r == floats[0]));
    }

    #[test]
    fn transparent_pixels_are_masked() {
        let f = Folder::new();
        let alpha = |i: usize| if i == 3 { 0 } else { 1 + i as u8 };
        let la: Vec<u8> = (0..N).flat_map(|i| [RAMP[i], alpha(i)]).collect();
        let rgba: Vec<u8> = (0..N).flat_map(|i| [RAMP[i], RAMP[i], RAMP[i], alpha(i)]).collect();
        let wide = |v: &[u8]| v.iter().map(|&v| stretched(v)).collect::<Vec<u16>>();
        GrayAlphaImage::from_raw(W, H, la.clone()).unwrap().save(f.at("la8.png")).unwrap();
        RgbaImage::from_raw(W, H, rgba.clone()).unwrap().save(f.at("rgba8.png")).unwrap();
        RgbaImage::from_raw(W, H, rgba.clone()).unwrap().save(f.at("rgba8.tif")).unwrap();
        ImageBuffer::<LumaA<u16>, _>::from_raw(W, H, wide(&la)).unwrap().save(f.at("la16.png")).unwrap();
        ImageBuffer::<Rgba<u16>, _>::from_raw(W, H, wide(&rgba)).unwrap().save(f.at("rgba16.tif")).unwrap();
        let floats: Vec<f32> = rgba.iter().map(|&v| v as f32).collect();
        f.tiff::<colortype::RGBA32Float>("rgba32.tif", &floats);

        let plain = f.grey8("plain.png", RAMP);
        let expected =
            pair(&plain, &plain, Some(&f.grey8("mask.png", std::array::from_fn(|i| u8::from(i == 3)))));
        let expected = expected.unwrap();
        for name in ["la8.png", "rgba8.png", "rgba8.tif", "la16.png", "rgba16.tif", "rgba32.tif"] {
            let pair = pair(&f.at(name), &f.at(name), None).unwrap();
            assert_eq!(masked(pair.left()), [3], "{name}");
            assert_eq!(pair.left(), expected.left(), "{name}");
        }
    }

    #[test]
    fn the_colours_of_a_mask_count_and_its_alpha_does_not() {
        let f = Folder::new();
        let mut rgba = [0, 0, 0, 255].repeat(N);
        rgba[5 * 4 + 2] = 1;
        RgbaImage::from_raw(W, H, rgba).unwrap().save(f.at("m.png")).unwrap();
        let plane = mask(&f.at("m.png")).unwrap();
        assert_eq!((0..N).filter(|&i| plane.data()[i]).collect::<Vec<_>>(), [5]);
        let path = f.tiff::<colortype::Gray32Float>(
            "m.tif",
            &[0.0, -0.0, f32::NAN, 1e-9, 0., 0., 0., 0., 0., 0., 0., 0.],
        );
        let plane = mask(&path).unwrap();
        assert_eq!((0..N).filter(|&i| plane.data()[i]).collect::<Vec<_>>(), [2, 3]);
    }

    #[test]
    fn levels_are_the_upper_eight_bits() {
        let f = Folder::new();
        assert_eq!(grey8(&f.grey8("a.png", RAMP)).unwrap().data(), RAMP);
        let words = f.grey16("b.png", RAMP.map(|v| u16::from(v) * 257));
        assert_eq!(grey8(&words).unwrap().data(), RAMP);
        let colours = RAMP.iter().flat_map(|&v| [v; 3]).collect();
        RgbImage::from_raw(W, H, colours).unwrap().save(f.at("c.png")).unwrap();
        assert_eq!(grey8(&f.at("c.png")).unwrap().data(), RAMP);
        refused(grey8(&f.tiff::<colortype::Gray32Float>("d.tif", &[0.0; N])), &["d.tif", "float"]);
    }

    #[test]
    fn floats_are_spread_jointly() {
        let f = Folder::new();
        let left: [f32; N] = [0.0, 0.25, 0.5, f32::NAN, 0., 0., 0., 0., 0., 0., 0., 0.];
        let right: [f32; N] = [-1.0, 1.0, f32::INFINITY, f32::NEG_INFINITY, 0., 0., 0., 0., 0., 0., 0., 0.];
        let l = f.tiff::<colortype::Gray32Float>("l.tif", &left);
        let r = f.at("r.pfm");
        pfm::write(&r, &Plane::new(W as usize, H as usize, right.to_vec())).unwrap();
        let both = pair(&l, &r, None).unwrap();
        assert_eq!(greys(both.left())[..4], [32640, 40800, 48960, 0]);
        assert_eq!(greys(both.right())[..5], [0, 65280, 0, 0, 32640]);
        assert_eq!((masked(both.left()), masked(both.right())), (vec![3], vec![2, 3]));

        // Doubles beyond the range of floats, whose difference is beyond that of doubles.
        let wide = f.tiff::<colortype::Gray64Float>(
            "d.tif",
            &[-1.7e308, 1.7e308, 0.0, f64::NAN, 0., 0., 0., 0., 0., 0., 0., 0.],
        );
        assert_eq!(greys(pair(&wide, &wide, None).unwrap().left())[..4], [0, 65280, 32640, 0]);
    }

    #[test]
    fn constant_and_wholly_masked_floats_are_black() {
        let f = Folder::new();
        for value in [7.5, 0.0, f32::NAN, f32::MAX] {
            let path = f.tiff::<colortype::Gray32Float>("a.tif", &[value; N]);
            let pair = pair(&path, &path, None).unwrap();
            assert_eq!(greys(pair.left()), [0; N], "{value}");
            assert_eq!(masked(pair.left()).len(), if value.is_nan() { N } else { 0 });
        }
    }

    #[test]
    fn float_colours_and_signed_words() {
        let f = Folder::new();
        let rgb: Vec<f64> = (0..N * 3).map(|i| i as f64).collect();
        let double = f.tiff::<colortype::RGB64Float>("d.tif", &rgb);
        let float =
            f.tiff::<colortype::RGB32Float>("f.tif", &rgb.iter().map(|&v| v as f32).collect::<Vec<_>>());
        let pair = pair(&double, &float, None).unwrap();
        assert_eq!(pair.left(), pair.right());
        assert_eq!(pair.left().pixels[(0, 0)][0], 0);
        assert_eq!(pair.left().pixels[(3, 2)][2], 65280);
        let signed: Vec<i16> = (0..N as i16).map(|i| i * 100 - 500).collect();
        let signed = f.tiff::<colortype::GrayI16>("s.tif", &signed);
        let pair = self::pair(&signed, &signed, None).unwrap();
        assert_eq!((greys(pair.left())[0], greys(pair.left())[N - 1]), (0, 65280));
    }

    #[test]
    fn tiff_with_grey_and_alpha_and_in_planes() {
        let f = Folder::new();
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
        let mut image = encoder.new_image::<colortype::Gray8>(W, H).unwrap();
        image.extra_samples(&[ExtraSamples::UnassociatedAlpha]).unwrap();
        let la: Vec<u8> = (0..N).flat_map(|i| [RAMP[i], u8::from(i != 6)]).collect();
        image.write_data(&la).unwrap();
        let path = f.bytes("la.tif", bytes.get_ref());
        let pair = pair(&path, &path, None).unwrap();
        assert_eq!(masked(pair.left()), [6]);
        assert_eq!(greys(pair.left())[11], 255 << 8);

        let planes: Vec<u8> = [RAMP, [7; N], RAMP.map(|v| 255 - v)].concat();
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
        let mut directory = encoder.image_directory().unwrap();
        let offset = directory.write_data(planes.as_slice()).unwrap() as u32;
        let n = N as u32;
        directory.write_tag(Tag::ImageWidth, W).unwrap();
        directory.write_tag(Tag::ImageLength, H).unwrap();
        directory.write_tag(Tag::BitsPerSample, [8_u16; 3].as_slice()).unwrap();
        directory.write_tag(Tag::PhotometricInterpretation, 2_u16).unwrap();
        directory.write_tag(Tag::SamplesPerPixel, 3_u16).unwrap();
        directory.write_tag(Tag::PlanarConfiguration, 2_u16).unwrap();
        directory.write_tag(Tag::StripOffsets, [offset, offset + n, offset + 2 * n].as_slice()).unwrap();
        directory.write_tag(Tag::StripByteCounts, [n; 3].as_slice()).unwrap();
        directory.finish().unwrap();
        let path = f.bytes("planes.tif", bytes.get_ref());
        let pair = self::pair(&path, &path, None).unwrap();
        assert_eq!(pair.left().pixels[(1, 2)][..3], [200 << 8, 7 << 8, 55 << 8]);
    }

    #[test]
    fn the_content_decides_and_not_the_name() {
        let f = Folder::new();
        let expected = f.grey8("a.png", RAMP);
        fs::copy(&expected, f.at("a.jpg")).unwrap();
        fs::copy(&expected, f.at("a")).unwrap();
        let text: Vec<String> = RAMP.iter().map(u8::to_string).collect();
        let pgm = f.bytes("a.tif", format!("P2\n# by hand\n4 3\n255\n{}\n", text.join(" ")).as_bytes());
        let expected = pair(&expected, &expected, None).unwrap();
        assert_eq!(pair(&f.at("a.jpg"), &f.at("a"), None).unwrap(), expected);
        assert_eq!(pair(&pgm, &pgm, None).unwrap(), expected);
    }

    #[test]
    fn jpeg_is_read_and_its_end_is_missed() {
        let f = Folder::new();
        let image = RgbImage::from_fn(64, 48, |x, y| Rgb([x as u8 * 4, y as u8 * 5, 128]));
        let path = f.at("a.jpg");
        image.save(&path).unwrap();
        assert_eq!(pair(&path, &path, None).unwrap().size(), (64, 48));
        let whole = fs::read(&path).unwrap();
        for cut in [1, 2, 50, whole.len() / 2, whole.len() - 4] {
            let path = f.bytes("cut.jpg", &whole[..whole.len() - cut]);
            refused(pair(&path, &path, None), &["cut.jpg", "get the file again"]);
        }
    }

    #[test]
    fn what_does_not_belong_together_is_refused() {
        let f = Folder::new();
        let left = f.grey8("left.png", RAMP);
        let small = f.at("small.png");
        GrayImage::new(2, 3).save(&small).unwrap();
        refused(pair(&left, &small, None), &["left.png is 4 x 3", "small.png is 2 x 3"]);
        refused(pair(&left, &left, Some(&small)), &["small.png is 2 x 3", "left.png is 4 x 3", "mask"]);
        let float = f.tiff::<colortype::Gray32Float>("float.tif", &[0.0; N]);
        refused(pair(&left, &float, None), &["left.png", "float.tif", "one format"]);
    }

    #[test]
    fn files_that_are_no_images_are_refused() {
        let f = Folder::new();
        let good = f.grey8("good.png", RAMP);
        let bad = |path: &Path, words: &[&str]| {
            refused(pair(path, &good, None), words);
            refused(pair(&good, path, None), words);
            refused(pair(&good, &good, Some(path)), words);
            refused(read_disparity(path), words);
        };
        bad(&f.at("missing.png"), &["missing.png", "no such file"]);
        bad(f.0.path(), &["folder"]);
        bad(&f.bytes("empty.png", b""), &["empty.png", "is empty"]);
        bad(
            &f.bytes("text.png", b"What is this?\nNo image.\n"),
            &["text.png", "PNG, JPEG, PNM, TIFF or PFM"],
        );
        bad(&f.bytes("a.png", b"GIF89a....................."), &["gif", "PNG, JPEG, PNM, TIFF or PFM"]);
        bad(&f.bytes("huge.pgm", b"P5\n4000000000 4000000000\n255\n"), &["huge.pgm", "at most"]);
        bad(&f.bytes("none.pgm", b"P5\n0 5\n255\n"), &["none.pgm"]);
        bad(&f.bytes("lie.pgm", b"P5\n30000 30000\n255\n"), &["lie.pgm", "get the file again"]);
        bad(&f.bytes("short.pgm", b"P5\n30 30\n255\n1234"), &["short.pgm"]);
        bad(&f.bytes("huge.pfm", b"Pf\n2000000000 2000000000\n-1\n"), &["huge.pfm", "at most"]);
        #[cfg(target_os = "linux")]
        bad(Path::new("/dev/zero"), &["not an image"]);
        // A PNG whose header claims much.
        let mut png = fs::read(&good).unwrap();
        png[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
        bad(&f.bytes("huge.png", &png), &["huge.png"]);
    }

    /// One small file of each kind.
    fn samples(f: &Folder) -> Vec<Vec<u8>> {
        f.grey8("a.png", RAMP);
        f.grey8("a.pgm", RAMP);
        f.grey8("a.tif", RAMP);
        f.grey8("a.jpg", RAMP);
        f.tiff::<colortype::RGB32Float>("b.tif", &[1.5; N * 3]);
        pfm::write(&f.at("a.pfm"), &Plane::filled(4, 3, 2.0)).unwrap();
        let mut bytes = Cursor::new(Vec::new());
        for compression in [tiff::encoder::Compression::Lzw, tiff::encoder::Compression::Packbits] {
            bytes = Cursor::new(Vec::new());
            let encoder = TiffEncoder::new(&mut bytes).unwrap();
            encoder.with_compression(compression).write_image::<colortype::Gray16>(W, H, &[300; N]).unwrap();
        }
        let mut files: Vec<_> = ["a.png", "a.pgm", "a.tif", "a.jpg", "b.tif", "a.pfm"]
            .map(|name| fs::read(f.at(name)).unwrap())
            .into();
        files.push(bytes.into_inner());
        files
    }

    #[test]
    fn every_truncation_is_an_error() {
        for whole in samples(&Folder::new()) {
            assert!(decode(&whole).is_ok());
            // The trailer of a PNG file says nothing about its pixels.
            let end = if whole.starts_with(b"\x89PNG") { whole.len() - 12 } else { whole.len() };
            for length in 0..end {
                assert!(
                    decode(&whole[..length]).is_err(),
                    "{length} of {} bytes: {:?}",
                    whole.len(),
                    &whole[..4]
                );
            }
        }
    }

    #[test]
    fn damaged_files_never_panic_and_never_lie_about_their_size() {
        let mut state = 1_u32;
        let mut random = move |n: usize| {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            state as usize % n
        };
        for whole in samples(&Folder::new()) {
            for _ in 0..4000 {
                let mut bytes = whole.clone();
                for _ in 0..=random(3) {
                    let at = random(bytes.len());
                    bytes[at] = [0, 1, 0x7f, 0x80, 0xff, random(256) as u8][random(6)];
                }
                match decode(&bytes) {
                    Ok(raster) => {
                        let n = raster.width * raster.height * raster.channels;
                        let length = match &raster.samples {
                            Samples::Byte(v) => v.len(),
                            Samples::Word(v) => v.len(),
                            Samples::Float(v) => v.len(),
                            Samples::Double(v) => v.len(),
                        };
                        assert_eq!(length, n);
                    }
                    Err(reason) => assert!(!reason.contains('\n')),
                }
            }
        }
    }

    #[test]
    fn disparities_are_refused_where_their_scale_is_unknown() {
        let f = Folder::new();
        refused(read_disparity(&f.grey8("d.png", RAMP)), &["d.png", "8-bit PNG", "16-bit"]);
        refused(read_disparity(&f.grey16("d.tif", [9; N])), &["d.tif", "float .tif"]);
        refused(read_disparity(&f.grey8("d.pgm", RAMP)), &["d.pgm", ".pfm"]);
        let rgb = ImageBuffer::<Rgb<u16>, Vec<u16>>::new(W, H);
        rgb.save(f.at("flow.png")).unwrap();
        refused(read_disparity(&f.at("flow.png")), &["flow.png", "more than one channel"]);
        let word = f.grey16("k.png", [0, 1, 256, 65535, 0, 0, 0, 0, 0, 0, 0, 128]);
        let map = read_disparity(&word).unwrap();
        let i = f32::INFINITY;
        assert_eq!(map.data(), [i, 1.0 / 256.0, 1.0, 65535.0 / 256.0, i, i, i, i, i, i, i, 0.5]);
        let double = f.tiff::<colortype::Gray64Float>(
            "d.tif",
            &[1.5, f64::NAN, f64::NEG_INFINITY, 1e300, -2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        );
        assert_eq!(read_disparity(&double).unwrap().data()[..6], [1.5, i, i, i, -2.0, 0.0]);
    }
}
