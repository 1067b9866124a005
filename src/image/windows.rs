//! Reads pairs by windows, in the memory of a window.

mod overview;
mod png_rows;
mod spill;
mod view;

pub use overview::Overview;

use std::fmt;
use std::path::Path;

use self::view::View;
use super::raster::{self, Extremes, Raster, Scale, Sizes};
use super::read::{Reader, check_mask};
use super::{Georeference, Image, Orientation, Pair, Rect};
use crate::error::{Error, Result};
use crate::threads;

/// Most bytes that stay in memory: of the samples of a decoded image, and of a strip or tile that is unpacked for
/// every window. Beyond that, images are unpacked into scratch files.
const KEPT: u64 = 1 << 26;

impl Reader {
    /// Opens a rectified pair like [`Reader::pair`], to be read by windows: for images that are larger than the memory.
    ///
    /// Strips and tiles of TIFF files are read from the file, those alone that a window needs; up to 64 MiB of unpacked ones
    /// of each image are kept, since neighbouring windows share them. Files of other kinds are unpacked, one after the
    /// other, and so are TIFF files whose strips or tiles are larger than that. Samples of more than 64 MiB go into a file
    /// without a name in the folder `scratch`, which vanishes with the pair. PNG files are unpacked row by row and TIFF
    /// files strip by strip; interlaced PNG files and those of other kinds must fit in memory. Images of more than 8 bits
    /// are read once from end to end, since their levels depend on all values of the pair. The files must stay as they are
    /// while windows are read.
    ///
    /// # Errors
    /// The errors of [`Reader::pair`], except that a damaged strip or tile may show up in [`PairWindows::window`] only;
    /// [`Error::Write`] when `scratch` cannot be written, or is full.
    pub fn windows(
        self,
        left: &Path,
        right: &Path,
        mask: Option<&Path>,
        scratch: &Path,
    ) -> Result<PairWindows> {
        self.windows_keeping(KEPT, [left, right], mask, scratch)
    }

    /// Like [`Reader::windows`], with another limit for what stays in memory.
    fn windows_keeping(
        self,
        kept: u64,
        [left, right]: [&Path; 2],
        mask: Option<&Path>,
        scratch: &Path,
    ) -> Result<PairWindows> {
        // One after the other: each may need the memory of a whole image.
        let first = View::open(self, left, scratch, kept)?;
        let no_value = Self { no_data: None, ..self };
        let mask = mask.map(|mask| View::open(no_value, mask, scratch, kept)).transpose()?;
        if let Some(mask) = &mask {
            check_mask((mask.path(), mask.size()), (left, first.size()))?;
        }
        let second = View::open(self, right, scratch, kept)?;
        let views = [first, second];
        let floats = views.each_ref().map(View::is_float);
        let names = [left, right].map(Path::display);
        raster::check_alike(views.each_ref().map(View::size), floats, names, Sizes::Equal)?;
        let doubts = views.each_ref().map(|view| view.doubt().map(str::to_owned));
        let mut windows =
            PairWindows { views, mask, doubts, scale: Scale::from_extremes(Extremes::new(), floats[0]) };
        let mut extremes = Extremes::new();
        for i in 0..2 {
            windows.add_to(&mut extremes, i)?;
        }
        windows.scale = Scale::from_extremes(extremes, floats[0]);
        Ok(windows)
    }

    /// (width, height) of an image in pixels, after it was turned if [`Reader::orient`] says so. Only the header is read, so
    /// pixels may be damaged; arrays in `.npz` are unpacked.
    ///
    /// # Errors
    /// [`Error::Read`] when the file is missing, has no valid header, claims too many pixels or is of an unknown kind.
    pub fn size(self, path: &Path) -> Result<(usize, usize)> {
        view::size(self, path)
    }
}

/// A rectified pair in files, of which [windows](Self::window) are read, from several threads at once if need be.
/// [`Reader::windows`] opens it.
pub struct PairWindows {
    views: [View; 2],
    /// That of the left image.
    mask: Option<View>,
    doubts: [Option<String>; 2],
    scale: Scale,
}

/// Prints only the size.
impl fmt::Debug for PairWindows {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (width, height) = self.size();
        write!(f, "PairWindows({width} x {height})")
    }
}

impl PairWindows {
    /// (width, height) of both images in pixels.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        self.views[0].size()
    }

    /// The pixels of both views in `part`: the very pair that [`Reader::pair`] and then [`Pair::crop`] give.
    ///
    /// # Errors
    /// [`Error::Mismatch`] when `part` is empty or not inside the images; [`Error::Read`] when the file is damaged there,
    /// or has changed; [`Error::Memory`] when the system has too little memory for the window.
    pub fn window(&self, part: &Rect) -> Result<Pair> {
        let (width, height) = self.size();
        if part.x.is_empty() || part.y.is_empty() || part.x.end > width || part.y.end > height {
            return Err(Error::Mismatch(format!(
                "columns {:?} and rows {:?} of a pair of {width} x {height}",
                part.x, part.y
            )));
        }
        raster::check_memory(part.size())?;
        let (left, right) = threads::join(|| self.image(0, part), || self.image(1, part));
        let moved = |georeference: Georeference| georeference.moved(part.x.start, part.y.start);
        let georeferences = self.georeferences().map(|georeference| georeference.map(moved));
        Ok(Pair { georeferences, doubts: self.doubts.clone(), ..Pair::new(left?, right?)? })
    }

    /// The georeferences of the whole images: see [`Pair::georeferences`]. Windows have their own.
    #[must_use]
    pub fn georeferences(&self) -> [Option<Georeference>; 2] {
        self.views.each_ref().map(View::georeference)
    }

    /// The orientation tags of the files of both images: see [`Pair::orientations`]. Windows count as upright, like other
    /// parts.
    #[must_use]
    pub fn orientations(&self) -> [Orientation; 2] {
        self.views.each_ref().map(View::orientation)
    }

    /// Why a part of the left and of the right image may be wrong: see [`Pair::doubts`]. Windows have these too.
    #[must_use]
    pub fn doubts(&self) -> &[Option<String>; 2] {
        &self.doubts
    }

    /// View `i` inside `part`.
    fn image(&self, i: usize, part: &Rect) -> Result<Image> {
        let raster = self.part(i, part)?;
        let masked = raster.masked();
        Ok(self.scale.apply(&raster, masked))
    }

    /// The samples of view `i` inside `part`, with the mask.
    fn part(&self, i: usize, part: &Rect) -> Result<Raster<'static>> {
        let raster = self.views[i].part(part)?;
        let Some(mask) = self.mask.as_ref().filter(|_| i == 0) else { return Ok(raster) };
        Ok(raster.ignoring(mask.part(part)?.not_black().into_data()))
    }

    /// Adds the unmasked samples of view `i` to `extremes`, if they matter.
    fn add_to(&self, extremes: &mut Extremes, i: usize) -> Result<()> {
        for piece in self.views[i].pieces() {
            let raster = self.part(i, &piece)?;
            extremes.add(&raster, &raster.masked());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
