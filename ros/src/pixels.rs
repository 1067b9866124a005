//! Conversion of ROS images to the library's.

use std::path::Path;

use mrfgs::error::Reason;
use mrfgs::image::raster::{Raster, Samples};
use mrfgs::image::read::Reader;

use crate::messages::{CompressedImage, Image, Result};

/// The supported encodings, for errors.
const KNOWN: &str = "mono8, mono16, bgr8, rgb8, bgra8, rgba8, their kinds of 16 bits, 8UC1, 8UC3, 8UC4, 16UC1, 16UC3, bayer_*, yuv422 (uyvy), \
                     yuv422_yuy2 (yuyv), nv12, nv21 and nv24 are supported";

/// The colours of a pixel, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Colours {
    Grey,
    /// Red first, or blue first; further channels are ignored.
    Rgb,
    Bgr,
    /// A Bayer pattern: the colours of two pixels of the first row, then of the second.
    Mosaic([Colour; 4]),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Colour {
    Red,
    Green,
    Blue,
}

/// The sample layout of an image.
struct Layout {
    colours: Colours,
    channels: usize,
    /// Bytes per sample: 1 or 2.
    bytes: usize,
}

impl Layout {
    fn of(encoding: &str) -> Option<Self> {
        if let Some(mosaic) = encoding.strip_prefix("bayer_") {
            let (letters, bits) = mosaic.split_at_checked(4)?;
            let bytes = match bits {
                "8" => 1,
                "16" => 2,
                _ => return None,
            };
            return Some(Self { colours: Colours::Mosaic(mosaic_of(letters)?), channels: 1, bytes });
        }
        let (colours, channels, bytes) = match encoding {
            "mono8" | "8UC1" => (Colours::Grey, 1, 1),
            "mono16" | "16UC1" => (Colours::Grey, 1, 2),
            "bgr8" | "8UC3" => (Colours::Bgr, 3, 1),
            "rgb8" => (Colours::Rgb, 3, 1),
            "bgra8" | "8UC4" => (Colours::Bgr, 4, 1),
            "rgba8" => (Colours::Rgb, 4, 1),
            "bgr16" | "16UC3" => (Colours::Bgr, 3, 2),
            "rgb16" => (Colours::Rgb, 3, 2),
            "bgra16" | "16UC4" => (Colours::Bgr, 4, 2),
            "rgba16" => (Colours::Rgb, 4, 2),
            _ => return None,
        };
        Some(Self { colours, channels, bytes })
    }
}

fn mosaic_of(letters: &str) -> Option<[Colour; 4]> {
    use Colour::{Blue, Green, Red};
    Some(match letters {
        "rggb" => [Red, Green, Green, Blue],
        "bggr" => [Blue, Green, Green, Red],
        "gbrg" => [Green, Blue, Red, Green],
        "grbg" => [Green, Red, Blue, Green],
        _ => return None,
    })
}

/// 8-bit luma and chroma, as sent by cameras and video encoders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Yuv {
    /// Two pixels in four bytes, with the positions of luma, u and v.
    Packed { luma: [usize; 2], chroma: [usize; 2] },
    /// A luma plane, followed by interleaved chroma in rows of the same stride; with the positions of u and v in a pair, and the columns
    /// and rows of pixels that share a pair.
    Planes { chroma: [usize; 2], shared: (usize, usize) },
}

impl Yuv {
    fn of(encoding: &str) -> Option<Self> {
        Some(match encoding {
            // The first name is used by ROS 1, and by ROS 2 before Iron.
            "yuv422" | "uyvy" | "UYVY" => Self::Packed { luma: [1, 3], chroma: [0, 2] },
            "yuv422_yuy2" | "yuyv" | "YUYV" | "yuy2" => Self::Packed { luma: [0, 2], chroma: [1, 3] },
            "nv12" | "NV12" => Self::Planes { chroma: [0, 1], shared: (2, 2) },
            "nv21" | "NV21" => Self::Planes { chroma: [1, 0], shared: (2, 2) },
            "nv24" | "NV24" => Self::Planes { chroma: [0, 1], shared: (1, 1) },
            _ => return None,
        })
    }

    /// Bytes of a row of `width` pixels; `None` for an invalid width.
    fn row(self, width: usize) -> Option<usize> {
        match self {
            Self::Packed { .. } => width.is_multiple_of(2).then_some(2 * width),
            Self::Planes { shared: (across, _), .. } => width.is_multiple_of(across).then_some(width),
        }
    }

    /// Number of chroma rows of `step` bytes; a pair per pixel needs two.
    fn more_rows(self, height: usize) -> usize {
        match self {
            Self::Packed { .. } => 0,
            Self::Planes { shared: (across, down), .. } => 2 * height.div_ceil(down) / across,
        }
    }

    /// Luma, u and v at (x, y).
    fn sample(self, data: &[u8], step: usize, height: usize, (x, y): (usize, usize)) -> [u8; 3] {
        match self {
            Self::Packed { luma, chroma: [u, v] } => {
                let four = &data[y * step + x / 2 * 4..][..4];
                [four[luma[x % 2]], four[u], four[v]]
            }
            Self::Planes { chroma: [u, v], shared: (across, down) } => {
                let two = &data[height * step + y / down * (2 * step / across) + x / across * 2..][..2];
                [data[y * step + x], two[u], two[v]]
            }
        }
    }
}

/// RGB from luma and chroma of ITU-R BT.601 (16 is black, 235 white), with the coefficients of OpenCV, which other ROS programs use.
fn rgb([luma, u, v]: [u8; 3]) -> [u8; 3] {
    // In 1/2^20 of a level: the scale of luma, and the chroma weights of red, green and blue.
    const LUMA: i32 = 1_220_542;
    let luma = (i32::from(luma) - 16).max(0) * LUMA;
    let [u, v] = [u, v].map(|chroma| i32::from(chroma) - 128);
    let sums = [luma + 1_673_527 * v, luma - 852_492 * v - 409_993 * u, luma + 2_116_026 * u];
    sums.map(|sum| ((sum + (1 << 19)) >> 20).clamp(0, 255) as u8)
}

/// Converts a message of at most `max_pixels` pixels. Bayer patterns are interpolated by the mean of the nearest samples.
///
/// # Errors
/// If the encoding is not supported, or the sizes contradict each other or the data.
pub fn image(message: &Image, max_pixels: u64) -> Result<Raster<'static>> {
    let Image { encoding, data, .. } = message;
    let [width, height, step] = [message.width, message.height, message.step].map(|v| v as usize);
    let (layout, yuv) = (Layout::of(encoding), Yuv::of(encoding));
    if layout.is_none() && yuv.is_none() {
        return Err(format!("its encoding is `{}`; {KNOWN}", shortened(encoding)).into());
    }
    if width == 0 || height == 0 {
        return Err(format!("has {width} x {height} pixels").into());
    }
    if width as u64 * height as u64 > max_pixels {
        return Err(format!("claims {width} x {height} pixels, but at most {max_pixels} are read").into());
    }
    let row = match (&layout, yuv) {
        (Some(layout), _) => Some(width * layout.channels * layout.bytes),
        (None, yuv) => yuv.and_then(|yuv| yuv.row(width)),
    };
    let Some(row) = row else {
        return Err(format!(
            "an image in {encoding} cannot be {width} pixels wide, as two pixels share a colour"
        )
        .into());
    };
    if step < row {
        return Err(
            format!("a row of {width} pixels in {encoding} has {row} bytes, but the step is {step}").into()
        );
    }
    let rows = height + yuv.map_or(0, |yuv| yuv.more_rows(height));
    if step as u64 * rows as u64 > data.len() as u64 {
        return Err(format!(
            "{rows} rows of {step} bytes are {} bytes, but there are {} bytes of data",
            step as u64 * rows as u64,
            data.len()
        )
        .into());
    }
    let Some(layout) = layout else {
        let yuv = yuv.into_iter();
        let places =
            yuv.flat_map(|yuv| (0..height).flat_map(move |y| (0..width).map(move |x| (yuv, (x, y)))));
        let pixels = places.flat_map(|(yuv, place)| rgb(yuv.sample(data, step, height, place)));
        let raster = Raster::new(width, height, 3, Samples::Byte(pixels.collect()));
        return raster.map_err(|e| Reason::from(e.to_string()));
    };
    let rows = data.chunks_exact(step).take(height).map(|line| &line[..row]);
    let size = (width, height);
    if layout.bytes == 1 {
        raster(&layout, size, rows.flatten().copied().collect(), |v| Samples::Byte(v.into()))
    } else {
        let word = if message.is_bigendian { u16::from_be_bytes } else { u16::from_le_bytes };
        let words = rows.flat_map(|line| line.chunks_exact(2)).map(|v| word([v[0], v[1]]));
        raster(&layout, size, words.collect(), |v| Samples::Word(v.into()))
    }
}

/// Decodes the PNG or JPEG file in a message, which errors call `name`.
///
/// # Errors
/// If the file is damaged, too large or of another format.
pub fn compressed(message: &CompressedImage, reader: Reader, name: &Path) -> mrfgs::Result<Raster<'static>> {
    let CompressedImage { format, data, .. } = message;
    if format.contains("compressedDepth") {
        return Err(mrfgs::Error::read(name, "contains depths, not a camera image; give an image topic"));
    }
    if is_video(format, data) {
        return Err(mrfgs::Error::read(
            name,
            "contains part of a film (such as H.264), not an image; decode it first, and give the image topic",
        ));
    }
    let raster = reader.raster_in_memory(name, data)?;
    // `image_transport` stores Bayer patterns, which OpenCV cannot name, as grey images.
    let encoding = format.split(';').next().unwrap_or_default().trim();
    match Layout::of(encoding) {
        Some(layout @ Layout { colours: Colours::Mosaic(_), .. }) if raster.channels() == 1 => {
            let size = raster.size();
            let made = match raster.samples() {
                Samples::Byte(v) => self::raster(&layout, size, v.to_vec(), |v| Samples::Byte(v.into())),
                Samples::Word(v) => self::raster(&layout, size, v.to_vec(), |v| Samples::Word(v.into())),
                _ => return Ok(raster),
            };
            made.map_err(|reason| mrfgs::Error::read(name, reason))
        }
        _ => Ok(raster),
    }
}

/// Whether a compressed image is actually part of a film, according to its format or first bytes.
fn is_video(format: &str, data: &[u8]) -> bool {
    let format = format.to_ascii_lowercase();
    let is_called =
        ["h264", "h265", "hevc", "avc", "av1", "vp8", "vp9"].iter().any(|codec| format.contains(codec));
    is_called || data.starts_with(&[0, 0, 1]) || data.starts_with(&[0, 0, 0, 1])
}

/// The image of all `samples`.
fn raster<S: Copy + Into<u32> + TryFrom<u32> + Default>(
    layout: &Layout,
    (width, height): (usize, usize),
    samples: Vec<S>,
    made: fn(Vec<S>) -> Samples<'static>,
) -> Result<Raster<'static>> {
    let pixels = || samples.chunks_exact(layout.channels);
    let (channels, samples) = match layout.colours {
        Colours::Grey => (1, samples),
        Colours::Rgb if layout.channels == 3 => (3, samples),
        Colours::Rgb => (3, pixels().flat_map(|p| [p[0], p[1], p[2]]).collect()),
        Colours::Bgr => (3, pixels().flat_map(|p| [p[2], p[1], p[0]]).collect()),
        Colours::Mosaic(mosaic) => (3, demosaiced(&samples, (width, height), mosaic)),
    };
    Raster::new(width, height, channels, made(samples)).map_err(|e| Reason::from(e.to_string()))
}

/// RGB of each pixel: its own sample, and the rounded mean of each other colour among its eight neighbours.
fn demosaiced<S: Copy + Into<u32> + TryFrom<u32> + Default>(
    samples: &[S],
    (width, height): (usize, usize),
    mosaic: [Colour; 4],
) -> Vec<S> {
    let mut out = Vec::with_capacity(3 * samples.len());
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let (mut sums, mut counts) = ([0; 3], [0; 3]);
        for v in y.saturating_sub(1)..(y + 2).min(height) {
            for u in x.saturating_sub(1)..(x + 2).min(width) {
                let colour = mosaic[2 * (v % 2) + u % 2] as usize;
                sums[colour] += samples[v * width + u].into();
                counts[colour] += 1;
            }
        }
        let own = mosaic[2 * (y % 2) + x % 2] as usize;
        (sums[own], counts[own]) = (samples[y * width + x].into(), 1);
        out.extend((0..3).map(|c| {
            // An image of one row or column lacks a colour.
            let mean = (sums[c] + counts[c] / 2).checked_div(counts[c]).unwrap_or(0);
            S::try_from(mean).unwrap_or_default()
        }));
    }
    out
}

/// The start of a text of arbitrary length.
fn shortened(text: &str) -> String {
    text.chars().take(40).filter(|c| !c.is_control()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MANY: u64 = 1 << 20;

    fn made(encoding: &str, (width, height): (u32, u32), step: u32, data: &[u8]) -> Result<Raster<'static>> {
        let message =
            Image { width, height, step, encoding: encoding.into(), data: data.into(), ..Image::default() };
        image(&message, MANY)
    }

    fn bytes(raster: &Raster) -> Vec<u8> {
        let Samples::Byte(bytes) = raster.samples() else { panic!("bytes") };
        bytes.to_vec()
    }

    #[test]
    fn colours_come_in_one_order() {
        for (encoding, pixel, wanted) in [
            ("mono8", &[7][..], &[7][..]),
            ("8UC1", &[7], &[7]),
            ("rgb8", &[1, 2, 3], &[1, 2, 3]),
            ("bgr8", &[3, 2, 1], &[1, 2, 3]),
            ("8UC3", &[3, 2, 1], &[1, 2, 3]),
            ("rgba8", &[1, 2, 3, 0], &[1, 2, 3]),
            ("bgra8", &[3, 2, 1, 0], &[1, 2, 3]),
        ] {
            // Two rows of two pixels, with padding.
            let row = [pixel, pixel, &[99, 98]].concat();
            let raster = made(encoding, (2, 2), row.len() as u32, &[&row[..], &row[..]].concat()).unwrap();
            assert_eq!(bytes(&raster), [wanted; 4].concat(), "{encoding}");
        }
    }

    #[test]
    fn words_have_either_order() {
        for (is_bigendian, wanted) in [(false, [0x0201, 0x0403]), (true, [0x0102, 0x0304])] {
            let encoding = "mono16".into();
            let data = [1, 2, 3, 4][..].into();
            let message =
                Image { width: 2, height: 1, step: 4, encoding, is_bigendian, data, ..Image::default() };
            let raster = image(&message, MANY).unwrap();
            let Samples::Word(words) = raster.samples() else { panic!("words") };
            assert_eq!(**words, wanted);
        }
    }

    #[test]
    fn mosaics_become_colours() {
        // Red 10, green 20 and blue 30 everywhere, in all four patterns.
        for (encoding, mosaic) in [
            ("bayer_rggb8", [10, 20, 20, 30]),
            ("bayer_bggr8", [30, 20, 20, 10]),
            ("bayer_gbrg8", [20, 30, 10, 20]),
            ("bayer_grbg8", [20, 10, 30, 20]),
        ] {
            let data: Vec<u8> = (0..5 * 4).map(|i| mosaic[2 * (i / 5 % 2) + i % 5 % 2]).collect();
            let raster = made(encoding, (5, 4), 5, &data).unwrap();
            assert_eq!(bytes(&raster), [10, 20, 30].repeat(20), "{encoding}");
        }
        // A ramp: means of two and of four neighbours, at the blue pixel (1, 1) and the green pixel (1, 0).
        let data: Vec<u8> = (0..16).map(|i| (10 * (i % 4) + i / 4) as u8).collect();
        let raster = bytes(&made("bayer_rggb8", (4, 4), 4, &data).unwrap());
        assert_eq!(raster[3 * 5..][..3], [11, 11, 11]);
        assert_eq!(raster[3..][..3], [10, 10, 11]);
        // Control: another pattern gives other colours.
        assert_ne!(bytes(&made("bayer_bggr8", (4, 4), 4, &data).unwrap()), raster);
    }

    /// Grey and colours of ITU-R BT.601 with OpenCV's RGB, within a level.
    const COLOURS: [([u8; 3], [u8; 3]); 5] = [
        ([16, 128, 128], [0, 0, 0]),
        ([126, 128, 128], [128, 128, 128]),
        ([81, 90, 240], [254, 0, 0]),
        ([145, 54, 34], [0, 255, 1]),
        ([41, 240, 110], [0, 0, 255]),
    ];

    #[test]
    fn luma_and_chroma_become_colours() {
        for (yuv, wanted) in COLOURS {
            let off = rgb(yuv).into_iter().zip(wanted).map(|(a, b)| a.abs_diff(b)).max();
            assert!(off <= Some(1), "{:?} for {wanted:?}", rgb(yuv));
        }
        // Two colours side by side, the same in both rows, so that all encodings represent the same pixels.
        let [(left, of_left), (right, of_right)] = [COLOURS[2], COLOURS[4]];
        let ([y, u, v], [other, s, t]) = (left, right);
        let packed = [[u, y, v, y, s, other, t, other], [y, u, y, v, other, s, other, t]];
        let luma = [y, y, other, other, 99, 98];
        let chroma = [u, v, s, t, 97, 96];
        let swapped = [v, u, t, s, 97, 96];
        let each = [u, v, u, v, s, t, s, t, 95, 94, 93, 92];
        let rows = |row: &[u8]| [row, &[99, 98], row, &[99, 98]].concat();
        for (encoding, step, data) in [
            ("yuv422", 10, rows(&packed[0])),
            ("uyvy", 10, rows(&packed[0])),
            ("yuv422_yuy2", 10, rows(&packed[1])),
            ("yuyv", 10, rows(&packed[1])),
            ("nv12", 6, [&luma[..], &luma, &chroma].concat()),
            ("nv21", 6, [&luma[..], &luma, &swapped].concat()),
            ("nv24", 6, [&luma[..], &luma, &each, &each].concat()),
        ] {
            let found = bytes(&made(encoding, (4, 2), step, &data).unwrap());
            let wanted = [of_left, of_left, of_right, of_right].repeat(2).concat();
            let off = found.iter().zip(&wanted).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(found.len() == wanted.len() && off <= Some(1), "{encoding}: {found:?}");
        }
        // Control: another byte order gives other colours.
        let found = bytes(&made("uyvy", (4, 2), 10, &rows(&packed[1])).unwrap());
        assert!(found[0].abs_diff(of_left[0]) > 1);
    }

    #[test]
    fn contradictions_are_reported() {
        let data = [0; 64];
        for (encoding, size, step, words) in [
            ("yuv444", (4, 4), 8, "`yuv444`; mono8, mono16"),
            ("yuv422", (3, 4), 8, "an image in yuv422 cannot be 3 pixels wide"),
            ("uyvy", (4, 9), 8, "9 rows of 8 bytes are 72 bytes, but there are 64 bytes"),
            ("nv12", (8, 6), 8, "9 rows of 8 bytes are 72 bytes, but there are 64 bytes"),
            ("nv24", (8, 3), 8, "9 rows of 8 bytes are 72 bytes, but there are 64 bytes"),
            ("bayer_rgbg8", (4, 4), 4, "`bayer_rgbg8`"),
            ("32FC1", (4, 4), 16, "`32FC1`"),
            ("mono8", (0, 4), 4, "0 x 4 pixels"),
            ("bgr8", (4, 4), 8, "has 12 bytes, but the step is 8"),
            ("mono8", (4, 17), 4, "17 rows of 4 bytes are 68 bytes, but there are 64 bytes"),
            ("mono8", (u32::MAX, u32::MAX), u32::MAX, "at most 1048576 are read"),
            ("mono8", (4, 4), u32::MAX, "4 rows of 4294967295 bytes are 17179869180"),
        ] {
            let said = made(encoding, size, step, &data).unwrap_err().to_string();
            assert!(said.contains(words), "{said}");
        }
    }

    #[test]
    fn files_in_messages_are_read() {
        let mut file = std::io::Cursor::new(Vec::new());
        let grey = ::image::GrayImage::from_fn(4, 4, |x, y| ::image::Luma([(10 * x + y) as u8]));
        grey.write_to(&mut file, ::image::ImageFormat::Png).unwrap();
        let read = |format: &str| {
            let data = file.get_ref()[..].into();
            let message = CompressedImage { format: format.into(), data, ..CompressedImage::default() };
            compressed(&message, Reader::default(), Path::new("a.mcap"))
        };
        assert_eq!(bytes(&read("mono8; png compressed ").unwrap()), grey.clone().into_raw());
        let colours = read("bayer_rggb8; png compressed ").unwrap();
        assert_eq!(bytes(&colours), bytes(&made("bayer_rggb8", (4, 4), 4, grey.as_raw()).unwrap()));
        assert!(read("16UC1; compressedDepth png").unwrap_err().to_string().contains("contains depths"));
        let said = read("h264").unwrap_err().to_string();
        assert!(said.contains("such as H.264") && said.contains("decode it first"), "{said}");
        let data = [0, 0, 0, 1, 0x67, 0x64][..].into();
        let message = CompressedImage { format: "jpeg".into(), data, ..CompressedImage::default() };
        let said = compressed(&message, Reader::default(), Path::new("a.mcap")).unwrap_err().to_string();
        assert!(said.contains("such as H.264"), "{said}");
    }
}
