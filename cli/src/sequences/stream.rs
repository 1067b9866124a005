//! Streams of frames in a file or a pipe: YUV4MPEG2 (ffmpeg's yuv4mpegpipe) or raw pixels.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use clap::ValueEnum;
use mrfgs::error::in_words;
use mrfgs::image::raster::{Raster, Samples};
use mrfgs::{Error, Result};

use crate::ffmpeg::{self, Complaint, Decoder};

/// Frames per second, as a fraction.
pub(crate) type FrameRate = (usize, usize);

/// The frames of a stream without a header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RawFrames {
    size: (usize, usize),
    format: PixelFormat,
}

/// Pixel formats of raw frames, by ffmpeg's names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PixelFormat {
    Gray,
    Gray16le,
    Rgb24,
    Bgr24,
}

/// Parses `WIDTHxHEIGHT,FORMAT`.
///
/// # Errors
/// A message with the accepted form.
pub(crate) fn raw_frames(text: &str) -> Result<RawFrames, String> {
    let said = "give WIDTHxHEIGHT,FORMAT, such as 1280x480,gray; formats are gray, gray16le, rgb24 and bgr24";
    let parsed = || {
        let (size, format) = text.split_once(',')?;
        let (width, height) = size.split_once('x')?;
        let number = |text: &str| text.parse().ok().filter(|n| (1..=1 << 24).contains(n));
        let format = PixelFormat::from_str(format, false).ok()?;
        Some(RawFrames { size: (number(width)?, number(height)?), format })
    };
    parsed().ok_or_else(|| said.into())
}

impl PixelFormat {
    fn bytes(self) -> usize {
        match self {
            Self::Gray => 1,
            Self::Gray16le => 2,
            Self::Rgb24 | Self::Bgr24 => 3,
        }
    }
}

/// Maximum bytes of a header, the same limit as the decoder's.
const MAX_HEADER: u64 = 1024;
/// The number of leading bytes that tell raw pixels from known formats.
const START: u64 = 9;
/// Peak memory per pixel in bytes while a frame is read: three 16-bit samples and their conversion.
const BYTES: u64 = 12;

/// A reader that counts its bytes.
struct Counted {
    bytes: Box<dyn BufRead + Send>,
    count: Arc<AtomicU64>,
}

impl Read for Counted {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let count = self.bytes.read(out)?;
        self.count.fetch_add(count as u64, Ordering::Relaxed);
        Ok(count)
    }
}

/// A stream of frames.
pub(super) struct Stream {
    name: PathBuf,
    frames: Format,
    /// The number of frames so far.
    count: usize,
    /// Bytes read so far, and bytes up to the end of the last complete frame.
    read: Arc<AtomicU64>,
    whole: u64,
    ended: bool,
    /// ffmpeg's warning, if it decodes the film.
    decoded: Option<Complaint>,
}

enum Format {
    Yuv(y4m::Decoder<Counted>, LumaRange),
    Raw(Counted, RawFrames),
}

/// The levels of black and white.
#[derive(Clone, Copy)]
enum LumaRange {
    /// 16 and 235, in 8 bits.
    Limited,
    /// 0 and 255, in 8 bits.
    Full,
}

impl Stream {
    /// Opens the stream in the file `path`, or `-` for standard input.
    pub(super) fn open(path: &Path, raw: Option<RawFrames>, max_pixels: u64) -> Result<Self> {
        let stdin = path == Path::new("-");
        let name = if stdin { PathBuf::from("standard input") } else { path.to_owned() };
        let error = |reason: String| Error::read(&name, reason);
        let mut bytes: Box<dyn BufRead + Send> = if stdin {
            Box::new(BufReader::new(io::stdin()))
        } else {
            Box::new(BufReader::new(File::open(path).map_err(|e| Error::read(path, e))?))
        };
        let mut decoded = None;
        if let Some(raw) = raw {
            check_size(raw.size, max_pixels).map_err(error)?;
            let mut start = Vec::new();
            let read = bytes.by_ref().take(START).read_to_end(&mut start);
            read.map_err(|e| Error::read(&name, e))?;
            check_start(&start).map_err(error)?;
            bytes = Box::new(io::Cursor::new(start).chain(bytes));
        } else {
            // Read up to the first newline, as a pipe may deliver the header in pieces.
            let mut header = Vec::new();
            let read = bytes.by_ref().take(MAX_HEADER).read_until(b'\n', &mut header);
            read.map_err(|e| Error::read(&name, e))?;
            if !stdin && ffmpeg::reads(&header) {
                let decoder = Decoder::new(path)?;
                decoded = Some(decoder.complaint());
                bytes = Box::new(BufReader::new(decoder));
                header.clear();
                let read = bytes.by_ref().take(MAX_HEADER).read_until(b'\n', &mut header);
                read.map_err(|e| Error::read(&name, e))?;
            }
            check_header(&header, max_pixels).map_err(error)?;
            bytes = Box::new(io::Cursor::new(header).chain(bytes));
        }
        let read = Arc::new(AtomicU64::new(0));
        let counted = Counted { bytes, count: read.clone() };
        let frames = if let Some(raw) = raw {
            Format::Raw(counted, raw)
        } else {
            let decoder = y4m::Decoder::new_with_limits(counted, y4m::Limits { bytes: usize::MAX });
            let decoder = decoder.map_err(|e| Error::read(&name, said(&e)))?;
            let full = decoder.get_raw_params().split(|b| *b == b' ').any(|word| word == b"XCOLORRANGE=FULL");
            Format::Yuv(decoder, if full { LumaRange::Full } else { LumaRange::Limited })
        };
        let whole = read.load(Ordering::Relaxed);
        Ok(Self { name, frames, count: 0, read, whole, ended: false, decoded })
    }

    pub(super) fn rate(&self) -> Option<FrameRate> {
        match &self.frames {
            Format::Yuv(decoder, _) => {
                let rate = decoder.get_framerate();
                (rate.num > 0 && rate.den > 0).then_some((rate.num, rate.den))
            }
            Format::Raw(..) => None,
        }
    }

    /// The file of the stream, if it is one.
    pub(super) fn file(&self) -> Option<&Path> {
        self.name.is_file().then_some(&self.name)
    }

    /// The film and ffmpeg's warning, if ffmpeg decodes it.
    pub(super) fn film(&self) -> Option<(&Path, Complaint)> {
        Some((&self.name, self.decoded.clone()?))
    }

    /// The next frame; `None` after the last one or an error.
    pub(super) fn next(&mut self) -> Option<Result<Raster<'static>>> {
        if self.ended {
            return None;
        }
        let frame = match &mut self.frames {
            Format::Yuv(decoder, range) => yuv_frame(decoder, *range),
            Format::Raw(bytes, raw) => raw_frame(bytes, *raw),
        };
        let read = self.read.load(Ordering::Relaxed);
        let count = self.count;
        self.ended = !matches!(frame, Ok(Some(_)));
        let error = |reason: &str| Some(Err(Error::read(&self.name, format!("frame {count:06} {reason}"))));
        match frame {
            Ok(Some(frame)) => {
                (self.count, self.whole) = (count + 1, read);
                Some(Ok(frame))
            }
            Ok(None) if read > self.whole => error("is cut off"),
            Ok(None) if count == 0 => Some(Err(Error::read(&self.name, "contains no frame"))),
            Ok(None) => None,
            Err(reason) => error(&reason),
        }
    }
}

fn check_size((width, height): (usize, usize), max_pixels: u64) -> Result<(), String> {
    let pixels = (width as u64).checked_mul(height as u64).filter(|pixels| *pixels <= max_pixels);
    let many = format!("frames of {width} x {height} exceed the limit of {max_pixels} pixels");
    let bytes = pixels.ok_or(many)?.saturating_mul(BYTES);
    let room = Vec::<u8>::new().try_reserve_exact(usize::try_from(bytes).unwrap_or(usize::MAX));
    room.map_err(|_| format!("there is not enough memory for frames of {width} x {height} pixels"))
}

/// Refuses known file formats in place of raw pixels, by their first [`START`] bytes.
fn check_start(start: &[u8]) -> Result<(), String> {
    if start.starts_with(b"YUV4MPEG2") {
        return Err("is YUV4MPEG2, which describes its own frames: remove --raw-frames".into());
    }
    if ffmpeg::reads(start) || start.starts_with(b"\x89PNG") {
        return Err("is a film or an image, not raw pixels: remove --raw-frames".into());
    }
    Ok(())
}

/// Refuses anything but YUV4MPEG2, and frames that are too large.
fn check_header(line: &[u8], max_pixels: u64) -> Result<(), String> {
    if line.is_empty() {
        return Err("is empty; if ffmpeg writes it, add -pix_fmt yuv444p and check ffmpeg's messages".into());
    }
    if !line.starts_with(b"YUV4MPEG2") {
        return Err("is neither a folder, nor a pattern such as 'left/*.png', nor a YUV4MPEG2 stream \
                    (ffmpeg: -f yuv4mpegpipe)"
            .into());
    }
    let number = |letter: u8| {
        let word =
            line.trim_ascii_end().split(|b| *b == b' ').skip(1).find(|word| word.first() == Some(&letter))?;
        std::str::from_utf8(&word[1..]).ok()?.parse::<usize>().ok().filter(|number| *number > 0)
    };
    let size = number(b'W').zip(number(b'H')).ok_or("its header lacks the frame size")?;
    check_size(size, max_pixels)
}

/// The message for an error of the decoder.
fn said(error: &y4m::Error) -> String {
    match error {
        y4m::Error::UnknownColorspace => {
            "its pixel format is not supported; use ffmpeg's -pix_fmt gray or yuv444p, or for all bits of a grey \
             camera -f rawvideo -pix_fmt gray16le with --raw-frames"
                .into()
        }
        y4m::Error::EOF => "is cut off".into(),
        y4m::Error::IoError(e) => in_words(e),
        y4m::Error::BadInput | y4m::Error::ParseError(_) | y4m::Error::OutOfMemory => "is damaged".into(),
    }
}

fn yuv_frame(
    decoder: &mut y4m::Decoder<Counted>,
    range: LumaRange,
) -> Result<Option<Raster<'static>>, String> {
    use y4m::Colorspace as C;
    let (width, height) = (decoder.get_width(), decoder.get_height());
    let (colours, bits) = (decoder.get_colorspace(), decoder.get_bit_depth());
    let frame = match decoder.read_frame() {
        Ok(frame) => frame,
        Err(y4m::Error::EOF) => return Ok(None),
        Err(e) => return Err(said(&e)),
    };
    let planes = [frame.get_y_plane(), frame.get_u_plane(), frame.get_v_plane()];
    let raster = if matches!(colours, C::Cmono | C::Cmono12) {
        let words = || planes[0].chunks_exact(2).map(|v| u16::from_le_bytes([v[0], v[1]])).collect();
        let samples =
            if bits == 8 { Samples::Byte(planes[0].to_vec().into()) } else { Samples::Word(words()) };
        Raster::new(width, height, 1, samples)
    } else {
        // Columns and rows of pixels per chroma sample.
        let shared = match colours {
            C::C444 | C::C444p10 | C::C444p12 => (1, 1),
            C::C422 | C::C422p10 | C::C422p12 => (2, 1),
            _ => (2, 2),
        };
        let rgb = to_rgb(planes, (width, height), shared, bits, range);
        Raster::new(width, height, 3, Samples::Byte(rgb.into()))
    };
    raster.map(Some).map_err(|e| e.to_string())
}

/// Converts luma and chroma of ITU-R BT.601 to 8-bit RGB. Chroma samples apply to all pixels that share them.
fn to_rgb(
    planes: [&[u8]; 3],
    (width, height): (usize, usize),
    (across, down): (usize, usize),
    bits: usize,
    range: LumaRange,
) -> Vec<u8> {
    // In 1/2^16 of an 8-bit level: the luma of black, the scale of luma, and the chroma weights of red, green and blue.
    let (black, luma, [rv, gu, gv, bu]) = match range {
        LumaRange::Limited => (16, 76_309, [104_597, -25_675, -53_279, 132_201]),
        LumaRange::Full => (0, 65_536, [91_881, -22_554, -46_802, 116_130]),
    };
    let more = bits - 8;
    let sample = |plane: &[u8], at: usize| match more {
        0 => i64::from(plane[at]),
        _ => i64::from(u16::from_le_bytes([plane[2 * at], plane[2 * at + 1]])),
    };
    let chroma_width = width.div_ceil(across);
    let mut out = Vec::with_capacity(3 * width * height);
    for y in 0..height {
        for x in 0..width {
            let at = y / down * chroma_width + x / across;
            let luma = luma * (sample(planes[0], y * width + x) - (black << more));
            let [u, v] = [planes[1], planes[2]].map(|plane| sample(plane, at) - (128 << more));
            let half = 1 << (15 + more);
            for sum in [luma + rv * v, luma + gu * u + gv * v, luma + bu * u] {
                out.push(((sum + half) >> (16 + more)).clamp(0, 255) as u8);
            }
        }
    }
    out
}

fn raw_frame(bytes: &mut Counted, raw: RawFrames) -> Result<Option<Raster<'static>>, String> {
    let RawFrames { size: (width, height), format } = raw;
    let mut data = vec![0; width * height * format.bytes()];
    match bytes.read_exact(&mut data) {
        Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => return Ok(None),
        Err(e) => return Err(in_words(&e)),
        Ok(()) => {}
    }
    let (channels, samples) = match format {
        PixelFormat::Gray => (1, Samples::Byte(data.into())),
        PixelFormat::Gray16le => {
            (1, Samples::Word(data.chunks_exact(2).map(|v| u16::from_le_bytes([v[0], v[1]])).collect()))
        }
        PixelFormat::Rgb24 => (3, Samples::Byte(data.into())),
        PixelFormat::Bgr24 => {
            data.chunks_exact_mut(3).for_each(|pixel| pixel.swap(0, 2));
            (3, Samples::Byte(data.into()))
        }
    };
    Raster::new(width, height, channels, samples).map(Some).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_those_of_the_standard() {
        // Luma and chroma of black, white and the primaries, from the tables of BT.601.
        let colours = [
            ([16, 128, 128], [0, 0, 0]),
            ([235, 128, 128], [255, 255, 255]),
            ([82, 90, 240], [255, 0, 0]),
            ([145, 54, 34], [0, 255, 0]),
            ([41, 240, 110], [0, 0, 255]),
        ];
        for (yuv, rgb) in colours {
            let yuv: [u8; 3] = yuv;
            let found = to_rgb([&yuv[..1], &yuv[1..2], &yuv[2..]], (1, 1), (1, 1), 8, LumaRange::Limited);
            let off = found.iter().zip(rgb).map(|(a, b): (&u8, i32)| (i32::from(*a) - b).abs()).max();
            assert!(off.is_some_and(|off| off <= 2), "{found:?} for {rgb:?}");
            // The same colours in 10 bits.
            let words = yuv.map(|v| (4 * u16::from(v)).to_le_bytes());
            let more = to_rgb([&words[0], &words[1], &words[2]], (1, 1), (1, 1), 10, LumaRange::Limited);
            assert_eq!(more, found);
        }
        let grey = to_rgb([&[77], &[128], &[128]], (1, 1), (1, 1), 8, LumaRange::Full);
        assert_eq!(grey, [77; 3]);
    }

    #[test]
    fn chroma_is_shared() {
        let luma = [100; 15];
        let planes: [&[u8]; 3] = [&luma, &[128, 200, 128, 128, 128, 128], &[128; 6]];
        let rgb = to_rgb(planes, (5, 3), (2, 2), 8, LumaRange::Full);
        let blue: Vec<usize> = (0..15).filter(|at| rgb[3 * at + 2] != 100).collect();
        assert_eq!(blue, [2, 3, 7, 8]);
    }

    #[test]
    fn raw_frames_are_said_in_one_way() {
        let wanted = RawFrames { size: (1280, 480), format: PixelFormat::Gray16le };
        assert_eq!(raw_frames("1280x480,gray16le"), Ok(wanted));
        for text in ["", "1280x480", "0x4,gray", "4x4,yuv420p", "4,4,gray", "99999999x1,gray"] {
            assert!(raw_frames(text).is_err(), "{text}");
        }
    }
}
