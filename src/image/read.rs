//! Reading pairs, masks and disparity maps.
//!
//! What a file is follows from its first bytes, never from its name.

use std::path::Path;

use image::ImageFormat;

use super::decode::{Kind, Raster, Samples, decode, load, raster, stretched};
use super::{Image, Pair, Pixel, Plane, grey};
use crate::error::{Error, Result};

/// Float values and the wider integers end here: 255 in 1/256 of an 8-bit level.
const LINEAR_TOP: f64 = 65280.0;

/// Most pixels of an image unless a [`Reader`] says otherwise: as many as 16,384 x 16,384.
pub const MAX_PIXELS: u64 = 1 << 28;

/// How files are read. The functions of this module read as the default does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reader {
    /// Most pixels that an image may have. A file whose header claims more is refused before memory is taken for them, so
    /// that a small file cannot take all there is. An image takes up to 32 bytes a pixel while it is read.
    pub max_pixels: u64,
}

impl Default for Reader {
    /// [`MAX_PIXELS`].
    fn default() -> Self {
        Self { max_pixels: MAX_PIXELS }
    }
}

impl Reader {
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
    /// Before that, whatever the file packs is unpacked: palettes become colours, 1, 2 and 4 bits of PNG and 1 bit of TIFF
    /// span the levels of 8 bits, PNM counts up to what it says is white, YCbCr and CMYK (JPEG, TIFF) become RGB, and
    /// interlaced rows come in order. TIFF of 2 or 4 bits, or with a palette, is refused. Pixels are taken as they are stored:
    /// an orientation in Exif data turns nothing, for it is as stored that a pair is rectified.
    ///
    /// Masked are pixels with alpha 0, a transparent palette entry included, and pixels with a value that is not finite;
    /// any other alpha says nothing. Negative values are values like others. `mask` is an image of the size of the
    /// left one; where it is not black, the left image is masked as well. A masked pixel holds zeros.
    ///
    /// # Errors
    /// [`Error::Read`] when a file is missing, damaged, too large (more than [`Reader::max_pixels`]) or of an unknown kind;
    /// [`Error::Mismatch`] when the sizes differ, or only one of the images has float values.
    pub fn pair(self, left: &Path, right: &Path, mask: Option<&Path>) -> Result<Pair> {
        let images = [raster(left, self.max_pixels)?, raster(right, self.max_pixels)?];
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
            let ignored = self.mask(path)?;
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

    /// Reads a mask from any image that [`Reader::pair`] reads: `true` where a pixel is not black (alpha does not count).
    ///
    /// # Errors
    /// [`Error::Read`] as [`Reader::pair`].
    pub fn mask(self, path: &Path) -> Result<Plane<bool>> {
        let raster = raster(path, self.max_pixels)?;
        let plane = match &raster.samples {
            Samples::Byte(v) => raster.plane(v, |c| c.iter().any(|&v| v != 0)),
            Samples::Word(v) => raster.plane(v, |c| c.iter().any(|&v| v != 0)),
            Samples::Float(v) => raster.plane(v, |c| c.iter().any(|&v| v != 0.0)),
            Samples::Double(v) => raster.plane(v, |c| c.iter().any(|&v| v != 0.0)),
        };
        Ok(plane)
    }

    /// Reads 8-bit levels, such as those of Middlebury's visibility masks, from any integer image that [`Reader::pair`] reads:
    /// of 16 bits the upper 8, of colours the grey.
    ///
    /// # Errors
    /// [`Error::Read`] as [`Reader::pair`], and for float values.
    pub fn grey8(self, path: &Path) -> Result<Plane<u8>> {
        let raster = raster(path, self.max_pixels)?;
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
    pub fn disparity(self, path: &Path) -> Result<Plane<f32>> {
        const REMEDY: &str = "disparity maps are .pfm, float .tif, or 16-bit .png with disparity times 256";
        let bytes = load(path, self.max_pixels)?;
        let kind = Kind::of(&bytes);
        let raster = decode(&bytes, self.max_pixels).map_err(|reason| Error::read(path, reason))?;
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
                return wrong(
                    "an 8-bit PNG does not tell the scale of its disparities (of a truth, --truth-scale does)",
                );
            }
            _ => return wrong("holds no disparities"),
        };
        Ok(Plane::new(raster.width, raster.height, values))
    }

    /// Reads an 8-bit PNG that holds disparities times `scale`, as the ground truth of the older Middlebury sets; 0 is
    /// unknown and becomes +infinity.
    ///
    /// # Errors
    /// [`Error::Read`] when the file is missing, damaged, or anything else than a grey 8-bit PNG.
    pub fn scaled_disparity(self, path: &Path, scale: f32) -> Result<Plane<f32>> {
        let bytes = load(path, self.max_pixels)?;
        let kind = Kind::of(&bytes);
        let raster = decode(&bytes, self.max_pixels).map_err(|reason| Error::read(path, reason))?;
        match (kind, raster.channels, raster.samples) {
            (Some(Kind::Coded(ImageFormat::Png)), 1, Samples::Byte(v)) => {
                let disparity = |v| if v == 0 { f32::INFINITY } else { f32::from(v) / scale };
                Ok(Plane::new(raster.width, raster.height, v.into_iter().map(disparity).collect()))
            }
            _ => Err(Error::read(
                path,
                "is no grey 8-bit PNG, and only such a truth has a scale; leave --truth-scale out",
            )),
        }
    }
}

/// [`Reader::pair`] by the default.
///
/// # Errors
/// Those of [`Reader::pair`].
pub fn pair(left: &Path, right: &Path, mask: Option<&Path>) -> Result<Pair> {
    Reader::default().pair(left, right, mask)
}

/// [`Reader::mask`] by the default.
///
/// # Errors
/// Those of [`Reader::mask`].
pub fn mask(path: &Path) -> Result<Plane<bool>> {
    Reader::default().mask(path)
}

/// [`Reader::grey8`] by the default.
///
/// # Errors
/// Those of [`Reader::grey8`].
pub fn grey8(path: &Path) -> Result<Plane<u8>> {
    Reader::default().grey8(path)
}

/// [`Reader::disparity`] by the default.
///
/// # Errors
/// Those of [`Reader::disparity`].
pub fn read_disparity(path: &Path) -> Result<Plane<f32>> {
    Reader::default().disparity(path)
}

/// [`Reader::scaled_disparity`] by the default.
///
/// # Errors
/// Those of [`Reader::scaled_disparity`].
pub fn scaled_disparity(path: &Path, scale: f32) -> Result<Plane<f32>> {
    Reader::default().scaled_disparity(path, scale)
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

#[cfg(test)]
mod tests;
