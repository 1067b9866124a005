//! Images as they are stored, and their conversion to the levels for the matcher.

use std::borrow::Cow;
use std::fmt::Display;

use super::georeference::Georeference;
use super::orientation::Orientation;
use super::{Image, Pair, Pixel, Plane, Rect, grey};
use crate::error::{Error, MemoryError, Purpose, Result};
use crate::memory;

/// Float values and wide integers are scaled up to this: 255 in 1/256 of an 8-bit level.
const LINEAR_TOP: f64 = 65280.0;

/// Samples as stored, with all channels of a pixel next to each other.
#[derive(Clone, Debug)]
pub enum Samples<'a> {
    /// 8 bits.
    Byte(Cow<'a, [u8]>),
    /// 16 bits.
    Word(Cow<'a, [u16]>),
    /// Float.
    Float(Cow<'a, [f32]>),
    /// Double precision, and integers that do not fit in a word.
    Double(Cow<'a, [f64]>),
}

impl Samples<'_> {
    pub(super) fn is_float(&self) -> bool {
        matches!(self, Self::Float(_) | Self::Double(_))
    }

    pub(super) fn len(&self) -> usize {
        of_any!(self, v => v.len())
    }
}

/// An image as stored, in a file or in memory.
#[derive(Clone, Debug)]
pub struct Raster<'a> {
    pub(super) width: usize,
    pub(super) height: usize,
    /// 1 grey, 2 grey and alpha, 3 colour, 4 colour and alpha.
    pub(super) channels: usize,
    pub(super) samples: Samples<'a>,
    /// `true` where a pixel holds no data, row by row; as large as the image.
    pub(super) no_data: Option<Vec<bool>>,
    /// The georeference of its file.
    pub(super) georeference: Option<Georeference>,
    /// The orientation tag of its file.
    pub(super) orientation: Orientation,
    /// Why a part of it may be wrong, as the end of a sentence, with the name of its file once that is known.
    pub(super) doubt: Option<String>,
}

/// The sample types of a frame in memory: `u8`, `u16`, `f32` and `f64`.
pub trait Sample: Copy + 'static {
    /// The number in double precision.
    fn double(self) -> f64;

    /// Samples of this type.
    fn samples(values: Cow<[Self]>) -> Samples
    where
        [Self]: ToOwned<Owned = Vec<Self>>;
}

macro_rules! kinds {
    ($($type:ty: $kind:ident),*) => {
        $(impl Sample for $type {
            fn double(self) -> f64 {
                self.into()
            }

            fn samples(values: Cow<[Self]>) -> Samples {
                Samples::$kind(values)
            }
        })*
    };
}

kinds!(u8: Byte, u16: Word, f32: Float, f64: Double);

/// Evaluates an expression for samples of any type.
macro_rules! of_any {
    ($samples:expr, $values:ident => $result:expr) => {
        match $samples {
            Samples::Byte($values) => $result,
            Samples::Word($values) => $result,
            Samples::Float($values) => $result,
            Samples::Double($values) => $result,
        }
    };
}
pub(super) use of_any;

impl<'a> Raster<'a> {
    /// Borrows a frame of `width` x `height` pixels with `channels` samples each. Rows begin `stride` samples
    /// apart; if that is more than the length of a row, they are copied.
    ///
    /// # Errors
    /// [`Error::Mismatch`] when it has no pixel, a number of channels other than 1 to 4, or `data` is too
    /// short for its rows; [`Error::Memory`] when the system has too little memory for the copy.
    pub fn borrowed<S: Sample>(
        data: &'a [S],
        (width, height): (usize, usize),
        channels: usize,
        stride: usize,
    ) -> Result<Self> {
        let row = width.checked_mul(channels).filter(|row| *row > 0 && *row <= stride && height > 0);
        let needed = row.and_then(|row| stride.checked_mul(height - 1)?.checked_add(row));
        let (Some(row), Some(needed)) = (row, needed.filter(|needed| *needed <= data.len())) else {
            return Err(Error::Mismatch(format!(
                "{} samples for {width} x {height} pixels of {channels} channels in rows of {stride} samples",
                data.len()
            )));
        };
        if row == stride {
            return Self::new(width, height, channels, S::samples(Cow::Borrowed(&data[..needed])));
        }
        let mut rows = memory::reserved(row * height)?;
        for line in data.chunks(stride).take(height) {
            rows.extend_from_slice(&line[..row]);
        }
        Self::new(width, height, channels, S::samples(Cow::Owned(rows)))
    }

    /// An image with `channels` samples per pixel: 1 grey, 2 grey and alpha, 3 red, green and blue, 4 these
    /// and alpha.
    ///
    /// # Errors
    /// [`Error::Mismatch`] when it has no pixel or another number of channels, or the number of `samples`
    /// does not match.
    pub fn new(width: usize, height: usize, channels: usize, samples: Samples<'a>) -> Result<Self> {
        let count = samples.len();
        let wanted = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(channels));
        if count == 0 || !(1..=4).contains(&channels) || wanted != Some(count) {
            return Err(Error::Mismatch(format!(
                "{count} samples for {width} x {height} pixels of {channels} channels: an image has pixels of 1 to 4 channels"
            )));
        }
        Ok(Self::of((width, height), channels, samples))
    }

    /// Like [`Raster::new`], for samples that are known to fit.
    pub(super) fn of((width, height): (usize, usize), channels: usize, samples: Samples<'a>) -> Self {
        let orientation = Orientation::UPRIGHT;
        Self { width, height, channels, samples, no_data: None, georeference: None, orientation, doubt: None }
    }

    /// Masks every pixel whose grey, or all of whose colour samples, have the stored `value`.
    ///
    /// # Errors
    /// [`Error::Memory`] when the system has too little memory.
    pub fn without(self, value: f64) -> Result<Self> {
        Ok(self.marked(value)?)
    }

    pub(super) fn marked(self, value: f64) -> Result<Self, MemoryError> {
        let ignored = holding(&self.samples, self.channels, self.colours(), value)?;
        Ok(self.ignoring(ignored))
    }

    /// Also masks the pixels where `ignored`, which is as large as the image, is `true`.
    pub(super) fn ignoring(mut self, mut ignored: Vec<bool>) -> Self {
        add(&mut ignored, self.no_data.as_deref());
        self.no_data = Some(ignored);
        self
    }

    /// Also masks the pixels where `ignored` is `true`.
    ///
    /// # Errors
    /// [`Error::Mismatch`] when the sizes differ.
    pub fn masked_by(self, ignored: Plane<bool>) -> Result<Self> {
        if ignored.size() != self.size() {
            let ((w, h), (width, height)) = (ignored.size(), self.size());
            return Err(Error::Mismatch(format!(
                "the mask is {w} x {h}, but its image is {width} x {height}"
            )));
        }
        Ok(self.ignoring(ignored.into_data()))
    }

    /// The damage, with the name of its file, from which the decoder recovered.
    #[must_use]
    pub fn doubt(&self) -> Option<&str> {
        self.doubt.as_deref()
    }

    /// (width, height) in pixels.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Samples per pixel: 1 grey, 2 grey and alpha, 3 colour, 4 colour and alpha.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// The samples as stored, row by row.
    #[must_use]
    pub fn samples(&self) -> &Samples<'a> {
        &self.samples
    }

    /// `true` for pixels without data, row by row: from its file, or from [`masked_by`](Self::masked_by).
    #[must_use]
    pub fn no_data(&self) -> Option<&[bool]> {
        self.no_data.as_deref()
    }

    /// The image inside `part`, without a georeference.
    ///
    /// # Errors
    /// [`Error::Mismatch`] when `part` is empty or not inside the image; [`Error::Memory`] when the system
    /// has too little memory.
    pub fn crop(&self, part: &Rect) -> Result<Raster<'static>> {
        fn rows<S: Copy>(samples: &[S], of: usize, part: &Rect, each: usize) -> Result<Vec<S>> {
            let mut out = memory::reserved(part.x.len() * part.y.len() * each)?;
            for row in samples.chunks(of * each).take(part.y.end).skip(part.y.start) {
                out.extend_from_slice(&row[part.x.start * each..part.x.end * each]);
            }
            Ok(out)
        }
        if part.x.is_empty() || part.y.is_empty() || part.x.end > self.width || part.y.end > self.height {
            let (width, height) = self.size();
            return Err(Error::Mismatch(format!(
                "columns {:?} and rows {:?} of an image of {width} x {height}",
                part.x, part.y
            )));
        }
        let (of, n) = (self.width, self.channels);
        let samples = of_any!(&self.samples, v => Sample::samples(rows(v, of, part, n)?.into()));
        let no_data = self.no_data.as_ref().map(|marked| rows(marked, of, part, 1)).transpose()?;
        let doubt = self.doubt.clone();
        Ok(Raster { no_data, doubt, ..Raster::new(part.x.len(), part.y.len(), n, samples)? })
    }

    /// `true` where alpha is 0 or a value is not finite.
    pub(super) fn masked(&self) -> Plane<bool> {
        let n = self.channels;
        let colours = self.colours();
        if n == colours && !self.samples.is_float() && self.no_data.is_none() {
            return Plane::filled(self.width, self.height, false);
        }
        let mut plane = of_any!(&self.samples, v => {
            let masked = v.chunks_exact(n).map(|p| {
                n > colours && p[colours].double() == 0.0
                    || !p[..colours].iter().all(|&v| v.double().is_finite())
            });
            Plane::new(self.width, self.height, masked.collect())
        });
        add(plane.data_mut(), self.no_data.as_deref());
        plane
    }

    /// Number of grey or colour samples.
    pub(super) fn colours(&self) -> usize {
        if self.channels < 3 { 1 } else { 3 }
    }

    /// Those of `values` that are grey or colour samples of unmasked pixels.
    fn unmasked<'b, S>(&self, values: &'b [S], masked: &'b Plane<bool>) -> impl Iterator<Item = &'b S> {
        let colours = self.colours();
        let pixels = values.chunks_exact(self.channels).zip(masked.data()).filter(|(_, masked)| !**masked);
        pixels.flat_map(move |(pixel, _)| &pixel[..colours])
    }
}

/// Adds another mask of the same size, if there is one.
fn add(masked: &mut [bool], other: Option<&[bool]>) {
    masked.iter_mut().zip(other.into_iter().flatten()).for_each(|(masked, other)| *masked |= other);
}

/// Whether the first `colours` of the `n` samples of each pixel are all `value`, rounded to their type. NaN
/// counts as equal to NaN.
#[allow(clippy::float_cmp, reason = "it is that very value that stands for no data")]
pub(super) fn holding(
    samples: &Samples,
    n: usize,
    colours: usize,
    value: f64,
) -> Result<Vec<bool>, MemoryError> {
    let mut out = memory::reserved(samples.len() / n)?;
    // A value written with fewer digits stands for the nearest float.
    let value = if matches!(samples, Samples::Float(_)) { f64::from(value as f32) } else { value };
    let holds = |v: f64| v == value || v.is_nan() && value.is_nan();
    of_any!(samples, v => {
        out.extend(v.chunks_exact(n).map(|pixel| pixel[..colours].iter().all(|&v| holds(v.double()))));
    });
    Ok(out)
}

/// An 8-bit level stretched to the 16-bit scale.
pub(in crate::image) fn stretched(v: u8) -> u16 {
    v as u16 * 257
}

impl Pair {
    /// A pair of two images in memory, scaled alike by the rules of [`Reader::pair`].
    ///
    /// # Errors
    /// [`Error::Mismatch`] when the sizes differ, or only one of the images has float values;
    /// [`Error::Memory`] when the system has too little memory.
    ///
    /// [`Reader::pair`]: super::read::Reader::pair
    pub fn of_frames(left: Raster, right: Raster) -> Result<Self> {
        joined([left, right], ["the left image", "the right one"], Sizes::Equal)
    }

    /// A pair of two raw images, which may differ in size: the pair has the larger one, and the smaller image
    /// is extended with masked pixels. A [`Rectification`](crate::rectification::Rectification) makes views
    /// of one size from them.
    ///
    /// # Errors
    /// The errors of [`Pair::of_frames`], except about sizes.
    pub fn of_raw_frames(left: Raster, right: Raster) -> Result<Self> {
        joined([left, right], ["the left image", "the right one"], Sizes::Any)
    }
}

/// The sizes that the images of a pair may have.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Sizes {
    Equal,
    Any,
}

/// Like [`Pair::of_frames`], for images that errors call by these names.
pub(super) fn joined(
    [left, right]: [Raster; 2],
    [of_left, of_right]: [impl Display; 2],
    sizes: Sizes,
) -> Result<Pair> {
    let images = [&left, &right];
    let own_sizes @ [(width, height), (w, h)] = images.map(Raster::size);
    check_alike(own_sizes, images.map(|image| image.samples.is_float()), [&of_left, &of_right], sizes)?;
    let size = (width.max(w), height.max(h));
    check_memory(size)?;
    let masks = images.map(Raster::masked);
    let scale = Scale::of(images, &masks);
    let [in_left, in_right] = masks;
    let georeferences = [&left, &right].map(|raster| raster.georeference.clone());
    let orientations = [left.orientation, right.orientation];
    let doubts = [left.doubt.clone(), right.doubt.clone()];
    let l = scale.apply(&left, in_left);
    drop(left);
    let r = scale.apply(&right, in_right);
    Ok(Pair {
        georeferences,
        orientations,
        doubts,
        own_sizes,
        ..Pair::new(l.extended_to(size), r.extended_to(size))?
    })
}

/// Fails for images that make no pair, by their sizes and by whether they hold floats. Errors call them by these names.
pub(super) fn check_alike(
    [(width, height), (w, h)]: [(usize, usize); 2],
    float: [bool; 2],
    [of_left, of_right]: [impl Display; 2],
    sizes: Sizes,
) -> Result<()> {
    if (width, height) != (w, h) && sizes == Sizes::Equal {
        return Err(Error::Mismatch(format!(
            "{of_left} is {width} x {height} and {of_right} is {w} x {h}: both images must have the same size"
        )));
    }
    if float[0] != float[1] {
        let [float, whole] = if float[0] { [&of_left, &of_right] } else { [&of_right, &of_left] };
        return Err(Error::Mismatch(format!(
            "{float} holds floats, but {whole} holds whole numbers: give both in the same format"
        )));
    }
    Ok(())
}

/// Fails when there is no memory for the pixels and masks of both views of this size.
pub(super) fn check_memory((width, height): (usize, usize)) -> Result<(), MemoryError> {
    let pixels = width as u64 * height as u64;
    memory::check(2 * pixels * (size_of::<Pixel>() + 1) as u64, Purpose::Image)
}

/// What the scale depends on: the unmasked samples of both images, added in any number of parts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extremes {
    /// Least and largest float.
    min: f64,
    max: f64,
    /// All bits that are set in words.
    bits: u16,
    /// Whether all words are stretched 8-bit levels.
    levels: bool,
}

impl Extremes {
    /// Those of no sample.
    pub(super) fn new() -> Self {
        Self { min: f64::INFINITY, max: f64::NEG_INFINITY, bits: 0, levels: true }
    }

    /// Adds the samples of `image`, or of a part of it, where it is not `masked`.
    pub(super) fn add(&mut self, image: &Raster, masked: &Plane<bool>) {
        let Self { mut min, mut max, mut bits, mut levels } = *self;
        match &image.samples {
            Samples::Float(_) | Samples::Double(_) => {
                of_any!(&image.samples, v => image.unmasked(v, masked).for_each(|&v| {
                    min = min.min(v.double());
                    max = max.max(v.double());
                }));
            }
            Samples::Word(v) => image.unmasked(v, masked).for_each(|&v| {
                bits |= v;
                levels &= v.is_multiple_of(257);
            }),
            // Bytes always fill their range.
            Samples::Byte(_) => {}
        }
        *self = Self { min, max, bits, levels };
    }
}

/// The conversion from samples to levels, the same for both images of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Scale {
    /// 8-bit levels, stored as they are or times 257.
    Level,
    /// Words with this many free bits at the top; 8-bit levels of the other view fill the same range.
    Shift(u32),
    /// Floats between these bounds.
    Linear { min: f64, max: f64 },
}

impl Scale {
    /// The scale for the unmasked samples.
    fn of(images: [&Raster; 2], masks: &[Plane<bool>; 2]) -> Self {
        let mut extremes = Extremes::new();
        images.into_iter().zip(masks).for_each(|(image, masked)| extremes.add(image, masked));
        Self::from_extremes(extremes, images[0].samples.is_float())
    }

    /// The scale for samples with these extremes, which are floats or whole numbers.
    pub(super) fn from_extremes(extremes: Extremes, float: bool) -> Self {
        let Extremes { min, max, bits, levels } = extremes;
        if float {
            return Self::Linear { min, max };
        }
        // Bytes always fill their range; words of 12 bits, say, must be shifted to match.
        if levels { Self::Level } else { Self::Shift(bits.leading_zeros().min(8)) }
    }

    /// The levels of `raster`, or of a part of it.
    pub(super) fn apply(self, raster: &Raster, masked: Plane<bool>) -> Image {
        let n = raster.channels;
        let pixels = match &raster.samples {
            Samples::Byte(v) => pixels(v, n, &masked, |v| self.byte(v)),
            Samples::Word(v) => pixels(v, n, &masked, |v| self.word(v)),
            Samples::Float(v) => pixels(v, n, &masked, |v| self.double(v as f64)),
            Samples::Double(v) => pixels(v, n, &masked, |v| self.double(v)),
        };
        Image { pixels, masked }
    }

    fn byte(self, v: u8) -> u16 {
        match self {
            // Words no larger than bytes count as levels too.
            Self::Shift(free) if free < 8 => stretched(v),
            _ => u16::from(v) << 8,
        }
    }

    fn word(self, v: u16) -> u16 {
        match self {
            Self::Shift(free) => v << free,
            Self::Level | Self::Linear { .. } => (v / 257) << 8,
        }
    }

    fn double(self, v: f64) -> u16 {
        match self {
            // Halves, because the difference of two doubles may overflow.
            Self::Linear { min, max } if max > min => {
                ((v / 2.0 - min / 2.0) / (max / 2.0 - min / 2.0) * LINEAR_TOP).round() as u16
            }
            _ => 0,
        }
    }
}

/// Pixels from samples of `n` channels; masked pixels become zero.
fn pixels<S: Copy>(samples: &[S], n: usize, masked: &Plane<bool>, level: impl Fn(S) -> u16) -> Plane<Pixel> {
    let of_grey = |v: S| [level(v); 4];
    let of_colour = |colour: [S; 3]| {
        let [r, g, b] = colour.map(&level);
        [r, g, b, grey(r, g, b)]
    };
    // A known number of channels gives a faster loop.
    match n {
        1 => pixels_of(samples, masked, |[v]| of_grey(v)),
        2 => pixels_of(samples, masked, |[v, _]| of_grey(v)),
        3 => pixels_of(samples, masked, of_colour),
        _ => pixels_of(samples, masked, |[r, g, b, _]| of_colour([r, g, b])),
    }
}

/// Pixels from samples of `N` channels.
fn pixels_of<S: Copy, const N: usize>(
    samples: &[S],
    masked: &Plane<bool>,
    pixel: impl Fn([S; N]) -> Pixel,
) -> Plane<Pixel> {
    let samples = samples.as_chunks::<N>().0.iter().zip(masked.data());
    let values = samples.map(|(samples, masked)| if *masked { [0; 4] } else { pixel(*samples) }).collect();
    Plane::new(masked.width(), masked.height(), values)
}
