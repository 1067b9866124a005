//! Reads pairs, masks and disparity maps.
//!
//! The kind of a file is detected from its first bytes, never from its name.

use std::path::Path;

use image::ImageFormat;

use super::decode::{Kind, decode, load};
use super::raster::{self, Raster, Sample, Samples, Sizes, of_any};
use super::{Pair, Plane, both, grey};
use crate::error::{Error, ReadError, Result};
use crate::threads;

pub use super::decode::is_guarded;
pub use super::file::MAX_PIXELS;

/// Disparities in PNG files with 16 bits are in 1/256 of a pixel, as in the KITTI benchmark.
const KITTI_SCALE: f32 = 256.0;

/// Settings for reading files. The functions of this module use the default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reader {
    /// Largest number of pixels of an image. A file whose header claims more is rejected before memory is
    /// allocated for them, so that a small file cannot exhaust the memory. Reading an image takes up to 32
    /// bytes per pixel.
    pub max_pixels: u64,
    /// The value that stands for no data, in both images of a pair and in disparity maps, as the file stores
    /// it: 0 to 255 for 8 bits, an index into the palette in TIFF. A pixel is masked where all of its samples
    /// have this value. `None`: the value that a TIFF file declares itself.
    pub no_data: Option<f64>,
    /// Whether to rotate images and masks upright by the tag `Orientation` of EXIF or TIFF. Rotated images
    /// have no georeference.
    pub orient: bool,
}

impl Default for Reader {
    /// [`MAX_PIXELS`], the no-data value that a file declares, and pixels as stored.
    fn default() -> Self {
        Self { max_pixels: MAX_PIXELS, no_data: None, orient: false }
    }
}

impl Reader {
    /// Reads a rectified pair from PNG, JPEG, PNM, TIFF, BMP or PFM files or NumPy arrays, detected by their content.
    ///
    /// Values become 1/256 of an 8-bit level:
    ///
    /// - 8 bits: times 256;
    /// - 16 bits: shifted up by as many bits as the largest unmasked value of both images leaves free (at most 8),
    ///   so that an 11-bit pair uses the whole range. Where all values are multiples of 257, they are 8-bit values
    ///   stretched to 16 bits, and give the same picture as those. An 8-bit image that comes with a 16-bit one is
    ///   stretched to the same range, and the largest value is that of the 16-bit one alone;
    /// - float, signed, or wider than 16 bits: linearly, from the least to the largest unmasked value of both images
    ///   to 0 ..= 65280.
    ///
    /// Before that, packed samples are unpacked: palettes become colours, fewer than 8 bits are stretched to
    /// all 8-bit levels, 9 to 15 bits become words, and PNM counts up to its declared white. YCbCr and CMYK
    /// (JPEG, TIFF) become RGB, images whose white is 0 are inverted, and colours premultiplied by alpha are
    /// divided by it. Rows, planes and tiles are put in order. A TIFF file with several images is read from
    /// the first one that is no reduced copy and no mask. Pixels are taken as they are stored, because a pair is
    /// rectified as it is stored; an orientation tag counts with [`Reader::orient`] alone. The tags of GeoTIFF
    /// come along ([`Pair::georeferences`]), unless one of them is damaged.
    ///
    /// A pixel is masked where its alpha is 0 (which includes a transparent palette entry), where one of its
    /// values is not finite, and where all of its samples stand for no data ([`Reader::no_data`]). Any other
    /// alpha is ignored. Negative values are ordinary values. `mask` is an image of the size of the left one;
    /// where it is not black, the left image, after it was turned, is masked as well. A masked pixel holds zeros.
    ///
    /// # Errors
    /// [`Error::Read`] when a file is missing, damaged, too large (more than [`Reader::max_pixels`]) or of an unknown kind;
    /// [`Error::Mismatch`] when the sizes differ, or only one of the images has float values.
    pub fn pair(self, left: &Path, right: &Path, mask: Option<&Path>) -> Result<Pair> {
        self.pair_of(left, right, mask, Sizes::Equal)
    }

    /// Reads a pair of raw images, which may differ in size: see [`Pair::of_raw_frames`].
    ///
    /// # Errors
    /// The errors of [`Reader::pair`], except about sizes.
    pub fn raw_pair(self, left: &Path, right: &Path, mask: Option<&Path>) -> Result<Pair> {
        self.pair_of(left, right, mask, Sizes::Any)
    }

    fn pair_of(self, left: &Path, right: &Path, mask: Option<&Path>, sizes: Sizes) -> Result<Pair> {
        let (first, second) = threads::join(|| self.raster(left), || self.raster(right));
        let (first, second) = (self.masked(first?, mask, left)?, second?);
        raster::joined([first, second], [left, right].map(Path::display), sizes)
    }

    /// Like [`Reader::pair`], from a file with both views: MPO with two images, or JPS with the right view on
    /// the left half unless it says otherwise. Also returns whether the file says which view is the left one.
    ///
    /// # Errors
    /// The errors of [`Reader::pair`], and when the file holds only one view.
    pub fn both(self, file: &Path, mask: Option<&Path>) -> Result<(Pair, bool)> {
        self.both_of(file, mask, Sizes::Equal)
    }

    /// Like [`Reader::both`], of raw images, which may differ in size: see [`Pair::of_raw_frames`].
    ///
    /// # Errors
    /// The errors of [`Reader::both`], except for views of two sizes.
    pub fn raw_both(self, file: &Path, mask: Option<&Path>) -> Result<(Pair, bool)> {
        self.both_of(file, mask, Sizes::Any)
    }

    fn both_of(self, file: &Path, mask: Option<&Path>, sizes: Sizes) -> Result<(Pair, bool)> {
        let bytes = load(file, self.max_pixels)?;
        let views = both::decode_both(file, &bytes, self.max_pixels, self.no_data, self.orient);
        let ([left, right], is_ordered) = views.map_err(|cause| Error::read(file, cause))?;
        let names = ["left", "right"].map(|side| format!("the {side} view in {}", file.display()));
        let pair = raster::joined([self.masked(left, mask, file)?, right], names, sizes)?;
        Ok((pair, is_ordered))
    }

    /// Applies the mask in the file `mask` to a left image.
    fn masked(self, image: Raster<'static>, mask: Option<&Path>, file: &Path) -> Result<Raster<'static>> {
        let Some(path) = mask else { return Ok(image) };
        let ignored = self.mask(path)?;
        check_mask((path, ignored.size()), (file, image.size()))?;
        image.masked_by(ignored)
    }

    /// Reads one image, as stored or upright: a single view, or two side by side. [`Pair::of_frames`] makes a pair of two.
    ///
    /// # Errors
    /// [`Error::Read`], like [`Reader::pair`].
    pub fn raster(self, path: &Path) -> Result<Raster<'static>> {
        self.raster_in_memory(path, &load(path, self.max_pixels)?)
    }

    /// The image rotated upright, if the reader is to do that.
    fn oriented<'a>(self, raster: Raster<'a>, path: &Path) -> Result<Raster<'a>> {
        if !self.orient {
            return Ok(raster);
        }
        raster.upright().map_err(|cause| Error::read(path, cause))
    }

    /// Like [`Reader::raster`], for masks and levels, in which no value means no data.
    fn whole(self, path: &Path) -> Result<Raster<'static>> {
        Self { no_data: None, ..self }.raster(path)
    }

    /// Like [`Reader::pair`], from files in memory, each with its name for errors.
    ///
    /// # Errors
    /// The errors of [`Reader::pair`].
    pub fn pair_in_memory(self, left: (&Path, &[u8]), right: (&Path, &[u8])) -> Result<Pair> {
        let image = |(name, bytes): (&Path, &[u8])| self.raster_in_memory(name, bytes);
        raster::joined([image(left)?, image(right)?], [left.0, right.0].map(Path::display), Sizes::Equal)
    }

    /// Like [`Reader::raster`], from a file in memory, with its name for errors.
    ///
    /// # Errors
    /// The errors of [`Reader::raster`].
    pub fn raster_in_memory(self, name: &Path, bytes: &[u8]) -> Result<Raster<'static>> {
        self.oriented(self.with_kind(name, bytes)?.1, name)
    }

    fn with_kind(self, name: &Path, bytes: &[u8]) -> Result<(Option<Kind>, Raster<'static>)> {
        let raster = decode(bytes, self.max_pixels, self.no_data);
        Ok((Kind::detect(bytes), raster.map_err(|cause| Error::read(name, cause))?.named(name)))
    }

    /// Reads a mask from any image that [`Reader::pair`] reads: `true` where a pixel is not black (alpha does not count).
    ///
    /// # Errors
    /// [`Error::Read`], like [`Reader::pair`].
    pub fn mask(self, path: &Path) -> Result<Plane<bool>> {
        Ok(self.whole(path)?.not_black())
    }

    /// Reads 8-bit levels, such as those of Middlebury's visibility masks, from any integer image that
    /// [`Reader::pair`] reads: the upper 8 of 16 bits, and the grey of colours.
    ///
    /// # Errors
    /// [`Error::Read`], like [`Reader::pair`], and for float values.
    pub fn grey8(self, path: &Path) -> Result<Plane<u8>> {
        let raster = self.whole(path)?;
        let shift = match &raster.samples {
            Samples::Byte(_) => 8,
            Samples::Word(_) => 0,
            Samples::Float(_) | Samples::Double(_) => {
                return Err(Error::read(path, "holds float values; give an 8-bit PNG"));
            }
        };
        Ok(of_any!(&raster.samples, v => raster.plane(v, |c| {
            let level = |i: usize| (c[i].double() as u16) << shift;
            let level = if c.len() == 3 { grey(level(0), level(1), level(2)) } else { level(0) };
            (level >> 8) as u8
        })))
    }

    /// Reads a disparity map in pixels; invalid pixels become +infinity. PFM, float TIFF and NumPy floats
    /// hold disparities directly (not finite = invalid), 16-bit PNG holds them times 256 (0 = invalid).
    ///
    /// # Errors
    /// [`Error::Read`] when the file is missing, damaged, or holds no disparities in one of these forms.
    pub fn disparity(self, path: &Path) -> Result<Plane<f32>> {
        self.map(path, &load(path, self.max_pixels)?, None)
    }

    /// Like [`Reader::disparity`], from a file in memory, with its name for errors.
    ///
    /// # Errors
    /// The errors of [`Reader::disparity`].
    pub fn disparity_in_memory(self, name: &Path, bytes: &[u8]) -> Result<Plane<f32>> {
        self.map(name, bytes, None)
    }

    /// Reads disparities times `scale`, stored as whole numbers in a PNG, TIFF or NumPy array with 8 or 16
    /// bits, as in the ground truth of the older Middlebury sets; 0 means unknown and becomes +infinity.
    ///
    /// # Errors
    /// [`Error::Read`] when the file is missing, damaged, or does not hold such numbers.
    pub fn scaled_disparity(self, path: &Path, scale: f32) -> Result<Plane<f32>> {
        self.map(path, &load(path, self.max_pixels)?, Some(scale))
    }

    /// Like [`Reader::scaled_disparity`], from a file in memory, with its name for errors.
    ///
    /// # Errors
    /// The errors of [`Reader::scaled_disparity`].
    pub fn scaled_disparity_in_memory(self, name: &Path, bytes: &[u8], scale: f32) -> Result<Plane<f32>> {
        self.map(name, bytes, Some(scale))
    }

    fn map(self, path: &Path, bytes: &[u8], scale: Option<f32>) -> Result<Plane<f32>> {
        fn scaled<S: Sample>(values: &[S], scale: f32) -> Vec<f32> {
            let disparity = |v: f64| if v == 0.0 { f32::INFINITY } else { v as f32 / scale };
            values.iter().map(|v| disparity(v.double())).collect()
        }
        const REMEDY: &str =
            "disparity maps are .pfm, float .tif or .npy, or 16-bit .png with disparity times 256";
        let (kind, raster) = self.with_kind(path, bytes)?;
        let wrong = |what: &str| Err(Error::read(path, format!("{what}; {REMEDY}")));
        let is_png = kind == Some(Kind::Coded(ImageFormat::Png));
        if raster.channels != 1 {
            return wrong("has more than one channel");
        }
        if !is_png && !matches!(kind, Some(Kind::Pfm | Kind::Tiff | Kind::Npy | Kind::Npz)) {
            return wrong("holds no disparities");
        }
        let valid = |d: f32| if d.is_finite() { d } else { f32::INFINITY };
        let values: Vec<f32> = match (raster.samples, scale) {
            (Samples::Float(_) | Samples::Double(_), Some(_)) => {
                return Err(Error::read(path, ReadError::NeedlessScale));
            }
            (Samples::Float(v), None) => v.iter().copied().map(valid).collect(),
            (Samples::Double(v), None) => v.iter().map(|d| valid(*d as f32)).collect(),
            (Samples::Byte(v), Some(scale)) => scaled(&v, scale),
            (Samples::Word(v), Some(scale)) => scaled(&v, scale),
            (Samples::Word(v), None) if is_png => scaled(&v, KITTI_SCALE),
            (Samples::Byte(_) | Samples::Word(_), None) => {
                return Err(Error::read(path, ReadError::UnknownScale));
            }
        };
        let mut map = Plane::new(raster.width, raster.height, values);
        for (disparity, no_data) in map.data_mut().iter_mut().zip(raster.no_data.iter().flatten()) {
            if *no_data {
                *disparity = f32::INFINITY;
            }
        }
        Ok(map)
    }
}

/// Fails when a mask and its image, each a file with its size, differ in size.
pub(super) fn check_mask(
    (mask, (w, h)): (&Path, (usize, usize)),
    (file, (width, height)): (&Path, (usize, usize)),
) -> Result<()> {
    if (w, h) == (width, height) {
        return Ok(());
    }
    Err(Error::Mismatch(format!(
        "the mask {} is {w} x {h} but {} is {width} x {height}: a mask must have the size of the left image",
        mask.display(),
        file.display()
    )))
}

impl Raster<'_> {
    /// `true` where a pixel is not black; alpha does not count.
    pub(super) fn not_black(&self) -> Plane<bool> {
        of_any!(&self.samples, v => self.plane(v, |c| c.iter().any(|&v| v.double() != 0.0)))
    }

    /// Prepends the name of its file to the doubt.
    pub(super) fn named(self, file: &Path) -> Self {
        Self { doubt: self.doubt.map(|doubt| format!("{}: {doubt}", file.display())), ..self }
    }

    /// Applies `f` to the grey or colour samples of each pixel.
    fn plane<S, T>(&self, samples: &[S], f: impl Fn(&[S]) -> T) -> Plane<T> {
        let colours = self.colours();
        let values = samples.chunks_exact(self.channels).map(|pixel| f(&pixel[..colours])).collect();
        Plane::new(self.width, self.height, values)
    }
}

impl Pair {
    /// Reads a rectified pair from two files, like [`Reader::pair`].
    ///
    /// # Errors
    /// The errors of [`Reader::pair`].
    pub fn open(left: impl AsRef<Path>, right: impl AsRef<Path>) -> Result<Self> {
        Reader::default().pair(left.as_ref(), right.as_ref(), None)
    }
}

/// [`Reader::grey8`] with the default settings.
///
/// # Errors
/// The errors of [`Reader::grey8`].
pub fn grey8(path: &Path) -> Result<Plane<u8>> {
    Reader::default().grey8(path)
}

/// [`Reader::disparity`] with the default settings.
///
/// # Errors
/// The errors of [`Reader::disparity`].
pub fn read_disparity(path: &Path) -> Result<Plane<f32>> {
    Reader::default().disparity(path)
}

#[cfg(test)]
mod tests;
