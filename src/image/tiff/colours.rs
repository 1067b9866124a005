//! The meaning of the samples of a TIFF file: grey, colours, palettes, inks and alpha.

use tiff::tags::Tag;

use super::directory::Directory;
use crate::error::ReadError;
use crate::image::file::{damaged, unsupported};
use crate::image::raster::{Sample, Samples};
use crate::memory;

const INK_SET: Tag = Tag::Unknown(332);
const YCBCR_COEFFICIENTS: Tag = Tag::Unknown(529);
const REFERENCE_BLACK_WHITE: Tag = Tag::Unknown(532);

/// The colour model of a pixel.
enum Model {
    Grey {
        white_is_zero: bool,
    },
    Rgb,
    /// Red, green and blue of every index.
    Palette(Vec<[u8; 3]>),
    Cmyk,
    YCbCr {
        coefficients: [f64; 3],
        black_white: [f64; 6],
    },
}

/// The kind of alpha, if any.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Alpha {
    None,
    /// The colours are not premultiplied.
    Plain,
    /// The colours are premultiplied by it.
    Premultiplied,
}

/// The meaning of the samples of a pixel.
pub(super) struct Colours {
    model: Model,
    alpha: Alpha,
    /// Bits of a sample.
    pub(super) bits: u32,
    /// Samples of a pixel, including those that are not read.
    pub(super) samples: usize,
    /// Columns and rows that share a pair of chroma samples.
    pub(super) subsampling: Option<(usize, usize)>,
}

impl Colours {
    /// The meaning that the directory declares.
    ///
    /// # Errors
    /// A description of what is not supported.
    pub(super) fn from_directory(directory: &Directory) -> Result<Self, ReadError> {
        let samples = directory.first(Tag::SamplesPerPixel, 1)? as usize;
        let bits = directory.equal(Tag::BitsPerSample, 1, "depths")?;
        if samples == 0 || samples > usize::from(u16::MAX) || !(1..=64).contains(&bits) {
            return Err(damaged(format!("the TIFF directory claims {samples} samples of {bits} bits")));
        }
        let bits = bits as u32;
        let extra = directory.unsigned(Tag::ExtraSamples)?;
        // The tag is required, but some programs forget it.
        let guess = if samples >= 3 { 2 } else { 1 };
        let photometric = directory.first(Tag::PhotometricInterpretation, guess)?;
        let model = match photometric {
            0 | 1 => Model::Grey { white_is_zero: photometric == 0 },
            2 => Model::Rgb,
            3 => Model::Palette(palette(directory, bits)?),
            5 => match directory.first(INK_SET, 1)? {
                1 if matches!(bits, 8 | 16) => Model::Cmyk,
                1 => return Err(unsupported(format!("holds inks of {bits} bits"))),
                _ => return Err(unsupported("holds inks other than cyan, magenta, yellow and black")),
            },
            6 if bits == 8 => Model::ycbcr(directory)?,
            4 => return Err("holds the mask of another image; give the image".into()),
            6 | 8..=10 | 32_844 | 32_845 => {
                let space = if photometric == 6 { "YCbCr" } else { "Lab or Luv" };
                return Err(unsupported(format!("holds {space} colours of {bits} bits")));
            }
            32_803 | 34_892 => {
                return Err("is a camera's raw file; develop it, and give the developed images".into());
            }
            other => return Err(unsupported(format!("has the unknown photometric interpretation {other}"))),
        };
        let colours = model.stored();
        let alpha = match extra.as_deref().and_then(|extra| extra.first()) {
            Some(1) => Alpha::Premultiplied,
            Some(2) => Alpha::Plain,
            // Many programs write alpha without declaring it.
            None if photometric == 2 && samples == 4 => Alpha::Plain,
            _ => Alpha::None,
        };
        let alpha = if samples > colours { alpha } else { Alpha::None };
        let known = colours + usize::from(alpha != Alpha::None);
        if samples < colours || colours == 1 && samples != known {
            let plural = if samples == 1 { "" } else { "s" };
            return Err(format!("has {samples} band{plural}; extract one, or red, green and blue").into());
        }
        let subsampling = match model {
            Model::YCbCr { .. } => {
                let values = directory.unsigned(Tag::ChromaSubsampling)?;
                match values.as_deref().unwrap_or(&[2, 2]) {
                    [across @ (1 | 2 | 4), down @ (1 | 2 | 4), ..] => {
                        Some((*across as usize, *down as usize))
                    }
                    _ => return Err(damaged("the TIFF chroma samples are stored in an unknown way")),
                }
            }
            _ => None,
        };
        if subsampling.is_some_and(|sub| sub != (1, 1)) && samples != 3 {
            return Err(unsupported(format!("holds YCbCr colours in {samples} samples")));
        }
        Ok(Self { model, alpha, bits, samples, subsampling })
    }

    /// Samples of a pixel's colour, as stored.
    pub(super) fn stored(&self) -> usize {
        self.model.stored()
    }

    /// Samples of a pixel that are read.
    pub(super) fn read(&self) -> usize {
        self.stored() + usize::from(self.alpha != Alpha::None)
    }

    /// Grey or red, green and blue, with alpha where there is one, and the number of channels. Unsigned
    /// samples of fewer than 8 bits are stretched to all 8-bit levels; those of 9 to 15 bits stay as they
    /// are.
    pub(super) fn levels(
        &self,
        mut samples: Samples<'static>,
    ) -> Result<(usize, Samples<'static>), ReadError> {
        let n = self.read();
        // The value of white.
        let white = if self.bits < 64 { (1_u64 << self.bits) - 1 } else { u64::MAX };
        if let Samples::Byte(v) = &mut samples
            && self.bits < 8
            && !matches!(self.model, Model::Palette(_))
        {
            let white = white as u32;
            v.to_mut().iter_mut().for_each(|v| *v = ((u32::from(*v) * 510 + white) / (2 * white)) as u8);
        }
        let (channels, mut samples) = match (&self.model, samples) {
            (Model::Grey { white_is_zero: true }, samples) => (1, inverted(samples, n, white)),
            (Model::Grey { .. }, samples) => (1, samples),
            (Model::Rgb, samples) => (3, samples),
            (Model::Palette(colours), Samples::Byte(v)) => {
                let rgb = |p: &[u8]| colours.get(usize::from(p[0])).copied();
                (3, self.replaced(&v, rgb, |alpha| alpha)?)
            }
            (Model::Palette(colours), Samples::Word(v)) => {
                // Alpha is scaled to the bits of the colours.
                let alpha = |a: u16| (u64::from(a) * 255 / white) as u8;
                let rgb = |p: &[u16]| colours.get(usize::from(p[0])).copied();
                (3, self.replaced(&v, rgb, alpha)?)
            }
            (Model::Cmyk, Samples::Byte(v)) => {
                let ink = |a: u8, b: u8| (u16::from(255 - a) * u16::from(255 - b) / 255) as u8;
                let rgb = |p: &[u8]| Some([0, 1, 2].map(|i| ink(p[i], p[3])));
                (3, self.replaced(&v, rgb, |alpha| alpha)?)
            }
            (Model::Cmyk, Samples::Word(v)) => {
                let ink =
                    |a: u16, b: u16| (u32::from(u16::MAX - a) * u32::from(u16::MAX - b) / 65_535) as u16;
                let rgb = |p: &[u16]| Some([0, 1, 2].map(|i| ink(p[i], p[3])));
                (3, self.replaced(&v, rgb, |alpha| alpha)?)
            }
            (Model::YCbCr { coefficients, black_white }, Samples::Byte(v)) => {
                let rgb = |p: &[u8]| Some(rgb_of(p, coefficients, black_white));
                (3, self.replaced(&v, rgb, |alpha| alpha)?)
            }
            _ => return Err(unsupported("holds colours in samples of another kind")),
        };
        if self.alpha == Alpha::None {
            return Ok((channels, samples));
        }
        if self.alpha == Alpha::Premultiplied {
            divide(&mut samples, channels + 1, white);
        }
        Ok((channels + 1, samples))
    }

    /// Replaces the colour of each pixel by red, green and blue, and keeps alpha; `rgb` returns `None` for an
    /// index beyond the palette.
    fn replaced<S: Copy, T: Sample>(
        &self,
        samples: &[S],
        rgb: impl Fn(&[S]) -> Option<[T; 3]>,
        alpha: impl Fn(S) -> T,
    ) -> Result<Samples<'static>, ReadError> {
        let (n, has_alpha) = (self.read(), self.alpha != Alpha::None);
        let count = samples.len() / n * (3 + usize::from(has_alpha));
        let mut out = memory::reserved(count)?;
        for pixel in samples.chunks_exact(n) {
            out.extend(rgb(pixel).ok_or_else(|| damaged("an index is beyond the end of the palette"))?);
            out.extend(has_alpha.then(|| alpha(pixel[n - 1])));
        }
        Ok(T::samples(out.into()))
    }
}

impl Model {
    /// Samples of a pixel's colour, as stored.
    fn stored(&self) -> usize {
        match self {
            Self::Grey { .. } | Self::Palette(_) => 1,
            Self::Rgb | Self::YCbCr { .. } => 3,
            Self::Cmyk => 4,
        }
    }

    fn ycbcr(directory: &Directory) -> Result<Self, ReadError> {
        let coefficients = directory.reals(YCBCR_COEFFICIENTS)?;
        let coefficients = coefficients.as_deref().and_then(|values| values.first_chunk().copied());
        let black_white = directory.reals(REFERENCE_BLACK_WHITE)?;
        let black_white = black_white.as_deref().and_then(|values| values.first_chunk().copied());
        let (coefficients, black_white): ([f64; 3], [f64; 6]) = (
            coefficients.unwrap_or([0.299, 0.587, 0.114]),
            black_white.unwrap_or([0.0, 255.0, 128.0, 255.0, 128.0, 255.0]),
        );
        let sound = coefficients[1] > 0.0 && black_white.chunks_exact(2).all(|pair| pair[1] > pair[0]);
        if !sound || !coefficients.iter().chain(&black_white).all(|value| value.is_finite()) {
            return Err(damaged("the TIFF file defines YCbCr colours that cannot be"));
        }
        Ok(Self::YCbCr { coefficients, black_white })
    }
}

/// Red, green and blue of every index of `bits` bits, in 8 bits.
fn palette(directory: &Directory, bits: u32) -> Result<Vec<[u8; 3]>, ReadError> {
    if bits > 16 {
        return Err(unsupported(format!("holds indices of {bits} bits into a palette")));
    }
    let map = directory.unsigned(Tag::ColorMap)?;
    let count = 1 << bits;
    let Some(map) = map.filter(|map| map.len() >= 3 * count) else {
        return Err(damaged("the TIFF palette is missing, or too short"));
    };
    // The standard says 16 bits, but some programs write 8.
    let shift = if map[..3 * count].iter().any(|v| *v > 255) { 8 } else { 0 };
    Ok((0..count).map(|i| [0, 1, 2].map(|c| (map[c * count + i] >> shift) as u8)).collect())
}

/// Inverts black and white, and leaves alpha as it is.
fn inverted(mut samples: Samples<'static>, n: usize, white: u64) -> Samples<'static> {
    fn each<S: Copy>(samples: &mut [S], n: usize, f: impl Fn(S) -> S) {
        samples.iter_mut().step_by(n).for_each(|v| *v = f(*v));
    }
    match &mut samples {
        Samples::Byte(v) => each(v.to_mut(), n, |v| 255 - v),
        Samples::Word(v) => each(v.to_mut(), n, |v| white as u16 - v),
        // Floats are scaled from their smallest to their largest value anyway.
        Samples::Float(v) => each(v.to_mut(), n, |v| -v),
        Samples::Double(v) => each(v.to_mut(), n, |v| -v),
    }
    samples
}

/// Divides the colours by the alpha that they were multiplied by; pixels with alpha 0 stay as they are.
fn divide(samples: &mut Samples<'static>, n: usize, white: u64) {
    fn each<S: Copy>(samples: &mut [S], n: usize, f: impl Fn(S, S) -> S) {
        for pixel in samples.chunks_exact_mut(n) {
            let alpha = pixel[n - 1];
            pixel[..n - 1].iter_mut().for_each(|v| *v = f(*v, alpha));
        }
    }
    let quotient = |v: u32, alpha: u32, white: u32| {
        (v * white + alpha / 2).checked_div(alpha).map_or(v, |v| v.min(white))
    };
    match samples {
        Samples::Byte(v) => each(v.to_mut(), n, |v, a| quotient(v.into(), a.into(), 255) as u8),
        Samples::Word(v) => each(v.to_mut(), n, |v, a| quotient(v.into(), a.into(), white as u32) as u16),
        Samples::Float(v) => each(v.to_mut(), n, |v, a| if a == 0.0 { v } else { v / a }),
        Samples::Double(v) => each(v.to_mut(), n, |v, a| if a == 0.0 { v } else { v / a }),
    }
}

/// Y, Cb and Cr of every pixel of `rows` rows, from units in which `across` x `down` pixels share a pair of
/// chroma samples.
pub(super) fn spread(
    stored: &[u8],
    width: usize,
    rows: usize,
    (across, down): (usize, usize),
) -> Result<Vec<u8>, ReadError> {
    let unit = across * down + 2;
    let units = width.div_ceil(across);
    let mut out = memory::reserved(3 * width * rows)?;
    for y in 0..rows {
        let line = &stored[y / down * units * unit..][..units * unit];
        for x in 0..width {
            let unit = &line[x / across * unit..][..unit];
            let chroma = &unit[across * down..];
            out.extend([unit[y % down * across + x % across], chroma[0], chroma[1]]);
        }
    }
    Ok(out)
}

/// Red, green and blue by section 21 of TIFF 6.0.
fn rgb_of(pixel: &[u8], [red, green, blue]: &[f64; 3], black_white: &[f64; 6]) -> [u8; 3] {
    let level = |i: usize, max: f64| {
        let (black, white) = (black_white[2 * i], black_white[2 * i + 1]);
        (f64::from(pixel[i]) - black) * max / (white - black)
    };
    let (y, cb, cr) = (level(0, 255.0), level(1, 127.0), level(2, 127.0));
    let r = y + cr * (2.0 - 2.0 * red);
    let b = y + cb * (2.0 - 2.0 * blue);
    let g = (y - blue * b - red * r) / green;
    [r, g, b].map(|v| (v + 0.5).clamp(0.0, 255.0) as u8)
}
