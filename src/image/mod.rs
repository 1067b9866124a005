//! Planes of pixels, and the stereo pair.

#[cfg(all(feature = "files", not(target_arch = "wasm32")))]
mod bands;
#[cfg(feature = "files")]
mod both;
#[cfg(feature = "files")]
mod bytes;
#[cfg(feature = "cameras")]
pub mod calib;
#[cfg(feature = "cameras")]
pub mod cloud;
pub(crate) mod cubic;
#[cfg(feature = "files")]
mod decode;
#[cfg(all(feature = "files", not(target_arch = "wasm32")))]
mod disk;
mod downsampled;
#[cfg(feature = "files")]
mod file;
#[cfg(feature = "cameras")]
mod fit;
#[cfg_attr(not(feature = "files"), path = "georeference_without_files.rs")]
mod georeference;
mod halved;
#[cfg(feature = "files")]
mod jpeg;
#[cfg(feature = "las")]
mod las;
#[cfg(feature = "files")]
mod npy;
mod orientation;
#[cfg(feature = "cameras")]
pub mod pcd;
#[cfg(feature = "files")]
pub mod pfm;
#[cfg(feature = "files")]
pub mod picture;
#[cfg(feature = "cameras")]
pub mod ply;
pub mod raster;
#[cfg(feature = "files")]
pub mod read;
#[cfg(feature = "cameras")]
pub mod read_cloud;
#[cfg(feature = "clouds")]
mod read_pcd;
#[cfg(feature = "cameras")]
mod read_ply;
#[cfg(feature = "files")]
mod save;
#[cfg(feature = "cameras")]
mod save_cloud;
#[cfg(feature = "files")]
mod tiff;
#[cfg(feature = "files")]
mod upright;
#[cfg(all(feature = "files", not(target_arch = "wasm32")))]
pub mod windows;
#[cfg(feature = "files")]
pub mod write;

pub use georeference::Georeference;
pub use orientation::Orientation;

use crate::error::{Error, Result};
use crate::threads;
use std::fmt;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// A part of an image: its columns and rows, in pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rect {
    /// Columns.
    pub x: Range<usize>,
    /// Rows.
    pub y: Range<usize>,
}

impl Rect {
    /// The whole of an image with this (width, height).
    #[must_use]
    pub fn whole((width, height): (usize, usize)) -> Self {
        Self { x: 0..width, y: 0..height }
    }

    /// (width, height) in pixels.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        (self.x.len(), self.y.len())
    }

    /// The same rectangle relative to the origin of `outer`, which contains it.
    #[must_use]
    pub fn within(&self, outer: &Self) -> Self {
        let (dx, dy) = (outer.x.start, outer.y.start);
        Self { x: self.x.start - dx..self.x.end - dx, y: self.y.start - dy..self.y.end - dy }
    }

    /// The mirrored rectangle in an image of this `width`.
    #[must_use]
    pub fn mirrored(&self, width: usize) -> Self {
        Self { x: width - self.x.end..width - self.x.start, y: self.y.clone() }
    }
}

/// A rectangle of values, row by row from the top left.
#[derive(Clone, PartialEq, Eq)]
pub struct Plane<T> {
    width: usize,
    height: usize,
    data: Vec<T>,
}

/// Prints only the size: the values of a map would fill a log.
impl<T> fmt::Debug for Plane<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Plane({} x {})", self.width, self.height)
    }
}

impl<T> Plane<T> {
    /// A plane of `width` x `height` values, row by row from the top left.
    ///
    /// # Panics
    /// When `data` does not hold exactly `width * height` values.
    #[must_use]
    pub fn new(width: usize, height: usize, data: Vec<T>) -> Self {
        assert_eq!(data.len(), width * height, "a plane of {width} x {height}");
        Self { width, height, data }
    }

    /// A plane whose value at (x, y) is `f(x, y)`.
    pub fn from_fn(width: usize, height: usize, mut f: impl FnMut(usize, usize) -> T) -> Self {
        let mut data = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                data.push(f(x, y));
            }
        }
        Self { width, height, data }
    }

    /// Width in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// (width, height) in pixels.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// All values, row by row.
    #[must_use]
    pub fn data(&self) -> &[T] {
        &self.data
    }

    /// All values, row by row, mutable.
    pub fn data_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// The values of these rows, mutable.
    ///
    /// # Panics
    /// When there are fewer rows.
    pub fn rows_mut(&mut self, rows: Range<usize>) -> &mut [T] {
        &mut self.data[rows.start * self.width..rows.end * self.width]
    }

    /// The values, row by row, moved out of the plane.
    #[must_use]
    pub fn into_data(self) -> Vec<T> {
        self.data
    }

    /// Row `y`.
    #[must_use]
    pub fn row(&self, y: usize) -> &[T] {
        &self.data[y * self.width..(y + 1) * self.width]
    }

    /// Row `y`, mutable.
    pub fn row_mut(&mut self, y: usize) -> &mut [T] {
        self.rows_mut(y..y + 1)
    }

    /// A plane of the same size with `f` applied to each value.
    pub fn map<U>(&self, f: impl FnMut(&T) -> U) -> Plane<U> {
        Plane { width: self.width, height: self.height, data: self.data.iter().map(f).collect() }
    }
}

impl<T: Clone> Plane<T> {
    /// The plane with left and right exchanged.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let mut data = Vec::with_capacity(self.data.len());
        for row in self.data.chunks(self.width.max(1)) {
            data.extend(row.iter().rev().cloned());
        }
        Self { width: self.width, height: self.height, data }
    }

    /// The plane with top and bottom exchanged.
    #[must_use]
    pub fn flipped(&self) -> Self {
        let rows: Vec<&[T]> = self.data.chunks(self.width.max(1)).rev().collect();
        Self { width: self.width, height: self.height, data: rows.concat() }
    }

    /// The plane with rows and columns exchanged.
    #[must_use]
    pub fn transposed(&self) -> Self {
        Self::from_fn(self.height, self.width, |x, y| self[(y, x)].clone())
    }

    /// The values in `part`.
    #[must_use]
    pub fn crop(&self, part: &Rect) -> Self {
        let rows: Vec<&[T]> = part.y.clone().map(|y| &self.row(y)[part.x.clone()]).collect();
        Self { width: part.x.len(), height: part.y.len(), data: rows.concat() }
    }

    /// Copies `values`, which have the size of `part`, to that part.
    ///
    /// # Panics
    /// When they have another size, or `part` is not inside the plane.
    pub fn paste(&mut self, values: &Self, part: &Rect)
    where
        T: Copy,
    {
        assert_eq!(values.size(), part.size(), "the values of the part");
        for (y, row) in part.y.clone().zip(values.data.chunks(values.width.max(1))) {
            self.row_mut(y)[part.x.clone()].copy_from_slice(row);
        }
    }

    /// The top left part of (width, height) pixels.
    #[must_use]
    pub(crate) fn cut_to(mut self, (width, height): (usize, usize)) -> Self {
        if self.width == width {
            self.data.truncate(width * height);
            return Self { height, ..self };
        }
        self.crop(&Rect::whole((width, height)))
    }

    /// A plane that holds `value` everywhere.
    #[must_use]
    pub fn filled(width: usize, height: usize, value: T) -> Self {
        Self { width, height, data: vec![value; width * height] }
    }
}

impl<T> std::ops::Index<(usize, usize)> for Plane<T> {
    type Output = T;

    /// The value at (x, y).
    fn index(&self, (x, y): (usize, usize)) -> &T {
        &self.data[y * self.width + x]
    }
}

impl<T> std::ops::IndexMut<(usize, usize)> for Plane<T> {
    /// The value at (x, y), mutable.
    fn index_mut(&mut self, (x, y): (usize, usize)) -> &mut T {
        &mut self.data[y * self.width + x]
    }
}

/// A pixel for the matcher: red, green, blue and grey, each in 1/256 of an 8-bit level (0 ..= 65280 from
/// 8-bit files, 0 ..= 65535 at most).
pub type Pixel = [u16; 4];

/// An image with its mask.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Colour and grey of each pixel.
    pub pixels: Plane<Pixel>,
    /// `true` for pixels without information, whose values are never read.
    pub masked: Plane<bool>,
}

/// Grey of a colour with the weights of ITU-R BT.601, in integers: round(0.299 r + 0.587 g + 0.114 b).
#[must_use]
pub fn grey(r: u16, g: u16, b: u16) -> u16 {
    ((299 * r as u32 + 587 * g as u32 + 114 * b as u32 + 500) / 1000) as u16
}

impl Image {
    /// An image from 8-bit colours, without masked pixels.
    #[must_use]
    pub fn from_rgb8(rgb: &Plane<[u8; 3]>) -> Self {
        let pixels = rgb.map(|&[r, g, b]| {
            let [r, g, b] = [r, g, b].map(|v| (v as u16) << 8);
            [r, g, b, grey(r, g, b)]
        });
        let masked = Plane::filled(rgb.width(), rgb.height(), false);
        Self { pixels, masked }
    }

    /// The colours in 8 bits, rounded down.
    #[must_use]
    pub fn to_rgb8(&self) -> Plane<[u8; 3]> {
        self.pixels.map(|&[r, g, b, _]| [r, g, b].map(|v| (v >> 8) as u8))
    }

    /// Whether any pixel is masked.
    #[must_use]
    pub(crate) fn any_masked(&self) -> bool {
        // Without a branch per pixel, this uses vector instructions.
        self.masked.data().chunks(1024).any(|some| some.iter().fold(false, |any, masked| any | masked))
    }

    /// Whether all colours are whole 8-bit levels.
    #[must_use]
    pub(crate) fn holds_bytes(&self) -> bool {
        // Without a branch per pixel, this uses vector instructions.
        let parts = |some: &[Pixel]| some.iter().fold(0, |all, [r, g, b, _]| all | r | g | b) & 0xff;
        self.pixels.data().chunks(1024).all(|some| parts(some) == 0)
    }

    /// The image with left and right exchanged.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        Self { pixels: self.pixels.mirrored(), masked: self.masked.mirrored() }
    }

    /// The image with top and bottom exchanged.
    #[must_use]
    pub fn flipped(&self) -> Self {
        Self { pixels: self.pixels.flipped(), masked: self.masked.flipped() }
    }

    /// The image with rows and columns exchanged.
    #[must_use]
    pub fn transposed(&self) -> Self {
        Self { pixels: self.pixels.transposed(), masked: self.masked.transposed() }
    }

    /// The image inside `part`.
    #[must_use]
    pub fn crop(&self, part: &Rect) -> Self {
        Self { pixels: self.pixels.crop(part), masked: self.masked.crop(part) }
    }

    /// Extends the image to this (width, height) with masked pixels on its right and below.
    fn extended_to(self, (width, height): (usize, usize)) -> Self {
        if self.pixels.size() == (width, height) {
            return self;
        }
        let inside = |x: usize, y: usize| x < self.width() && y < self.height();
        Self {
            pixels: Plane::from_fn(
                width,
                height,
                |x, y| if inside(x, y) { self.pixels[(x, y)] } else { [0; 4] },
            ),
            masked: Plane::from_fn(width, height, |x, y| !inside(x, y) || self.masked[(x, y)]),
        }
    }

    /// Width in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.pixels.width()
    }

    /// Height in pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        self.pixels.height()
    }
}

/// An image, or the half of a larger one, which is computed on first use: a device halves most pairs itself.
#[derive(Clone, Debug)]
struct View {
    image: OnceLock<Image>,
    /// (width, height).
    size: (usize, usize),
    /// The view at twice the size that `image` is computed from on first use; `None` for an image that was given or changed.
    larger: Option<Arc<View>>,
}

impl View {
    /// The half of `larger`, a view of even size.
    fn half_of(larger: Arc<View>) -> Self {
        let (width, height) = larger.size;
        Self { image: OnceLock::new(), size: (width / 2, height / 2), larger: Some(larger) }
    }

    /// (width, height).
    fn size(&self) -> (usize, usize) {
        self.size
    }

    /// The image. The first call may compute it on several threads, so it must not come from work that they share.
    fn image(&self) -> &Image {
        let larger = || self.larger.as_ref().expect("a view is an image or the half of one");
        self.image.get_or_init(|| larger().image().halved())
    }

    /// The image, which is no half of another one any more.
    fn image_mut(&mut self) -> &mut Image {
        self.image();
        self.larger = None;
        self.image.get_mut().expect("just computed")
    }
}

impl From<Image> for View {
    fn from(image: Image) -> Self {
        Self { size: image.pixels.size(), image: image.into(), larger: None }
    }
}

impl PartialEq for View {
    fn eq(&self, other: &Self) -> bool {
        self.image() == other.image()
    }
}

impl Eq for View {}

/// A rectified pair. The left image is the reference: its pixel (x, y) with disparity d appears at (x - d, y)
/// in the right image. Clones share the images.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pair {
    left: Arc<View>,
    right: Arc<View>,
    georeferences: [Option<Georeference>; 2],
    orientations: [Orientation; 2],
    doubts: [Option<String>; 2],
    full: Option<Box<Pair>>,
    /// Whether each pixel is the mean of a block of `full`, unchanged since [`Self::halved_on_use`].
    is_exact_half: bool,
    /// (width, height) of each image, without the masked extension to the size of the larger one.
    own_sizes: [(usize, usize); 2],
}

impl Pair {
    /// A pair of two images of the same size.
    ///
    /// # Errors
    /// [`Error::Mismatch`] when the sizes differ or the images are empty.
    pub fn new(left: Image, right: Image) -> Result<Self> {
        let (l, r) = (left.pixels.size(), right.pixels.size());
        if l != r {
            return Err(Error::Mismatch(format!(
                "the left image is {} x {} and the right one {} x {}: both images must have the same size",
                l.0, l.1, r.0, r.1
            )));
        }
        if l.0 == 0 || l.1 == 0 {
            return Err(Error::Mismatch("the images hold no pixel".into()));
        }
        Ok(Self::without_georeference(left, right))
    }

    fn without_georeference(left: Image, right: Image) -> Self {
        let own_sizes = [&left, &right].map(|image| image.pixels.size());
        Self {
            own_sizes,
            left: Arc::new(left.into()),
            right: Arc::new(right.into()),
            georeferences: [None, None],
            orientations: [Orientation::UPRIGHT; 2],
            doubts: [None, None],
            full: None,
            is_exact_half: false,
        }
    }

    /// The georeferences of the left and the right image, if they come from TIFF files with one. Maps have
    /// the pixels of their image, and so its georeference. Mirrored pairs have none.
    #[must_use]
    pub fn georeferences(&self) -> [Option<Georeference>; 2] {
        self.georeferences.clone()
    }

    /// The orientation tags of the files of both images: upright if [`read::Reader::orient`] has applied
    /// them. Parts and mirrored pairs count as upright.
    #[must_use]
    pub fn orientations(&self) -> [Orientation; 2] {
        self.orientations
    }

    /// Why a part of the left and of the right image may be wrong, each with the name of its file: see
    /// [`raster::Raster::doubt`]. Mirrored pairs have no doubts.
    #[must_use]
    pub fn doubts(&self) -> &[Option<String>; 2] {
        &self.doubts
    }

    /// The same pair with the doubts of the pair that it was made from.
    pub(crate) fn doubted_as(self, other: &Self) -> Self {
        Self { doubts: other.doubts.clone(), ..self }
    }

    /// The pair with its views exchanged.
    #[must_use]
    pub fn exchanged(mut self) -> Self {
        std::mem::swap(&mut self.left, &mut self.right);
        self.georeferences.swap(0, 1);
        self.orientations.swap(0, 1);
        self.doubts.swap(0, 1);
        self.own_sizes.swap(0, 1);
        self.full = self.full.map(|full| Box::new(full.exchanged()));
        self
    }

    /// The reference view.
    #[must_use]
    pub fn left(&self) -> &Image {
        self.left.image()
    }

    /// Both views, mutable; shared images are copied.
    pub(crate) fn views_mut(&mut self) -> [&mut Image; 2] {
        self.is_exact_half = false;
        [&mut self.left, &mut self.right].map(|view| Arc::make_mut(view).image_mut())
    }

    /// The other view.
    #[must_use]
    pub fn right(&self) -> &Image {
        self.right.image()
    }

    /// The mirrored pair: the mirrored right view takes the place of the left one, so disparities keep their
    /// values.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let full = self.full.as_ref().map(|full| Box::new(full.mirrored()));
        let mirrored = Self::without_georeference(self.right().mirrored(), self.left().mirrored());
        Self { full, is_exact_half: self.is_exact_half, ..mirrored }
    }

    /// Applies `f` to each view; the results must have the same size.
    pub(crate) fn map(&self, f: impl Fn(&Image) -> Image + Sync) -> Self {
        let (left, right) = threads::join(|| f(self.left()), || f(self.right()));
        Self::without_georeference(left, right).doubted_as(self)
    }

    /// The pair at its full size, if this one was [halved](Self::halved).
    #[must_use]
    pub fn full(&self) -> Option<&Self> {
        self.full.as_deref()
    }

    /// The same pair, as half the size of `full`.
    pub(crate) fn with_full(self, full: Option<Self>) -> Self {
        Self { full: full.map(Box::new), is_exact_half: false, ..self }
    }

    /// Whether each pixel is the mean of a block of the [full](Self::full) pair.
    pub(crate) fn is_exact_half(&self) -> bool {
        self.is_exact_half
    }

    /// The same pair with another left view of the same size.
    pub(crate) fn with_left(&self, left: Image) -> Self {
        Self { left: Arc::new(left.into()), is_exact_half: false, ..self.clone() }
    }

    /// The same pair with another right view of the same size.
    pub(crate) fn with_right(&self, right: Image) -> Self {
        Self { right: Arc::new(right.into()), is_exact_half: false, ..self.clone() }
    }

    /// Both views inside `part`.
    #[must_use]
    pub fn crop(&self, part: &Rect) -> Self {
        let double = |ends: &Range<usize>| 2 * ends.start..2 * ends.end;
        let larger = Rect { x: double(&part.x), y: double(&part.y) };
        let full = self.full.as_ref().map(|full| Box::new(full.crop(&larger)));
        let georeferences = self.georeferences.each_ref().map(|georeference| {
            georeference.as_ref().map(|georeference| georeference.moved(part.x.start, part.y.start))
        });
        Self { georeferences, full, is_exact_half: self.is_exact_half, ..self.map(|view| view.crop(part)) }
    }

    /// (width, height) of the left and the right image, which differ only in a [pair of raw images](Pair::of_raw_frames).
    #[must_use]
    pub fn own_sizes(&self) -> [(usize, usize); 2] {
        self.own_sizes
    }

    /// (width, height) of both views.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        self.left.size()
    }
}
