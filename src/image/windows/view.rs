//! One image in a file, of which parts are read.

use std::path::{Path, PathBuf};

use image::ImageFormat;

use super::png_rows::Png;
use super::spill::Spill;
use crate::error::{Error, ReadError, Result};
use crate::image::bytes::Bytes;
use crate::image::decode::{self, Kind, guarded, load};
use crate::image::disk::Disk;
use crate::image::file::max_bytes_of;
use crate::image::orientation::Orientation;
use crate::image::raster::{Raster, Samples, of_any};
use crate::image::read::Reader;
use crate::image::{Georeference, Rect, tiff};
use crate::memory::Claim;

/// Pixels of the pieces in which an image is read from end to end.
const PIECE: usize = 1 << 20;

/// First bytes of a file that hold almost any header, with the thumbnails that cameras put into it.
const HEADER: u64 = 1 << 20;

/// An image in a file.
pub(super) struct View {
    path: PathBuf,
    source: Source,
    /// By which the stored image is turned when parts are read; upright if it is not.
    turn: Orientation,
    /// That of the image after it was turned.
    orientation: Orientation,
    georeference: Option<Georeference>,
    doubt: Option<String>,
    /// (width, height) after it was turned.
    size: (usize, usize),
    is_float: bool,
    /// Whether its samples are of 8 bits.
    holds_bytes: bool,
}

/// Where the samples are, in the stored orientation.
enum Source {
    Tiff(Disk, Box<tiff::Stored>, tiff::Cache),
    Held(Raster<'static>),
    Spilled(Spill),
}

impl View {
    /// Opens an image. Samples of more than `kept` bytes that cannot be read in parts are unpacked into a file in `scratch`.
    ///
    /// # Errors
    /// The errors of [`Reader::raster`], and [`Error::Write`] when `scratch` cannot be written.
    pub(super) fn open(reader: Reader, path: &Path, scratch: &Path, kept: u64) -> Result<Self> {
        let error = |cause: ReadError| Error::read(path, cause);
        if let Some((file, image)) = tiff_on_disk(reader, path)?
            && let Some(bytes) = image.unpacked_bytes()
        {
            guarded(|| image.check_places(Bytes::OnDisk(&file))).map_err(error)?;
            let tag = image.orientation;
            let georeference = image.georeference.clone();
            let source = if bytes <= kept {
                Source::Tiff(file, image.into(), tiff::Cache::new(kept as usize))
            } else {
                // Stored, as the decoder gets it, and unpacked.
                let _claim = Claim::new(3 * bytes).map_err(|e| error(e.into()))?;
                Source::Spilled(unpacked(path, &file, &image, bytes, scratch)?)
            };
            return Self::of(reader, path, source, tag, georeference, None);
        }
        if let Some((spill, tag)) = unpacked_png(reader, path, scratch, kept)? {
            return Self::of(reader, path, Source::Spilled(spill), tag, None, None);
        }
        let stored = Reader { orient: false, ..reader }.raster(path)?;
        let (tag, georeference, doubt) =
            (stored.orientation, stored.georeference.clone(), stored.doubt.clone());
        let bytes: usize = of_any!(&stored.samples, v => size_of_val::<[_]>(v));
        let source = if bytes as u64 <= kept {
            Source::Held(stored)
        } else {
            let mut spill = Spill::new(scratch, stored.size(), &stored)?;
            spill.write(&stored, &Rect::whole(stored.size()))?;
            Source::Spilled(spill)
        };
        Self::of(reader, path, source, tag, georeference, doubt)
    }

    fn of(
        reader: Reader,
        path: &Path,
        source: Source,
        tag: Orientation,
        georeference: Option<Georeference>,
        doubt: Option<String>,
    ) -> Result<Self> {
        let turn = if reader.orient { tag } else { Orientation::UPRIGHT };
        let (stored, is_float, holds_bytes) = match &source {
            Source::Tiff(_, image, _) => {
                // Only samples themselves say for certain what type they become.
                let pixel = source.part(path, &Rect::whole((1, 1)))?;
                (image.size(), pixel.samples.is_float(), matches!(pixel.samples, Samples::Byte(_)))
            }
            Source::Held(raster) => {
                (raster.size(), raster.samples.is_float(), matches!(raster.samples, Samples::Byte(_)))
            }
            Source::Spilled(spill) => (spill.size(), spill.is_float(), spill.holds_bytes()),
        };
        Ok(Self {
            path: path.to_owned(),
            source,
            turn,
            orientation: if reader.orient { Orientation::UPRIGHT } else { tag },
            // That of a turned image would be wrong.
            georeference: georeference.filter(|_| turn.is_upright()),
            doubt,
            size: turn.turned(stored),
            is_float,
            holds_bytes,
        })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// (width, height) in pixels, after it was turned.
    pub(super) fn size(&self) -> (usize, usize) {
        self.size
    }

    pub(super) fn is_float(&self) -> bool {
        self.is_float
    }

    pub(super) fn doubt(&self) -> Option<&str> {
        self.doubt.as_deref()
    }

    pub(super) fn georeference(&self) -> Option<Georeference> {
        self.georeference.clone()
    }

    pub(super) fn orientation(&self) -> Orientation {
        self.orientation
    }

    /// The samples of `part`, which is not empty and inside the image.
    ///
    /// # Errors
    /// Errors of the file and about memory.
    pub(super) fn part(&self, part: &Rect) -> Result<Raster<'static>> {
        if self.turn.is_upright() {
            return self.source.part(&self.path, part);
        }
        let stored = self.source.part(&self.path, &self.turn.stored_part(part, self.size))?;
        let stored = Raster { orientation: self.turn, ..stored };
        stored.upright().map_err(|e| Error::read(&self.path, e))
    }

    /// Parts that cover the image and cost little memory, if its samples are of more than 8 bits.
    pub(super) fn pieces(&self) -> Vec<Rect> {
        if self.holds_bytes {
            return Vec::new();
        }
        let stored = self.turn.turned(self.size);
        let pieces = match &self.source {
            Source::Tiff(_, image, _) => image.pieces(PIECE),
            Source::Held(_) | Source::Spilled(_) => bands(stored).collect(),
        };
        let back = self.turn.inverse();
        pieces.iter().map(|piece| back.stored_part(piece, stored)).collect()
    }
}

impl Source {
    /// The samples of `part` of the stored image in the file `path`.
    fn part(&self, path: &Path, part: &Rect) -> Result<Raster<'static>> {
        match self {
            Self::Tiff(file, image, cache) => guarded(|| image.part(Bytes::OnDisk(file), part, Some(cache)))
                .map_err(|cause| Error::read(path, cause)),
            Self::Held(raster) => raster.crop(part),
            Self::Spilled(spill) => spill.part(part),
        }
    }
}

/// A file of this kind on the disk. `None` for all others, also those that are refused for another reason.
fn on_disk(reader: Reader, path: &Path, kind: Kind) -> Option<Disk> {
    let file = Disk::open(path).ok()??;
    let first = file.read(0, file.len().min(64)).ok()?;
    (Kind::detect(&first) == Some(kind) && file.len() <= max_bytes_of(reader.max_pixels)).then_some(file)
}

/// The image of a TIFF file on the disk, with the file; `None` like [`on_disk`].
fn tiff_on_disk(reader: Reader, path: &Path) -> Result<Option<(Disk, tiff::Stored)>> {
    let Some(file) = on_disk(reader, path, Kind::Tiff) else { return Ok(None) };
    let image = guarded(|| tiff::Stored::find(Bytes::OnDisk(&file), reader.max_pixels, reader.no_data));
    let image = image.map_err(|cause| Error::read(path, cause))?;
    Ok(Some((file, image)))
}

/// The samples of a TIFF file in a scratch file, unpacked strip by strip or tile by tile, of `bytes` bytes each.
fn unpacked(path: &Path, file: &Disk, image: &tiff::Stored, bytes: u64, scratch: &Path) -> Result<Spill> {
    let mut spill = None;
    for piece in image.pieces(PIECE) {
        // Its bands unpack it once.
        let cache = tiff::Cache::new(usize::try_from(bytes).unwrap_or(usize::MAX));
        for band in bands(piece.size()) {
            let y = piece.y.start + band.y.start..piece.y.start + band.y.end;
            let band = Rect { x: piece.x.clone(), y };
            let raster = guarded(|| image.part(Bytes::OnDisk(file), &band, Some(&cache)));
            let raster = raster.map_err(|cause| Error::read(path, cause))?;
            let spill = match &mut spill {
                Some(spill) => spill,
                none => none.insert(Spill::new(scratch, image.size(), &raster)?),
            };
            spill.write(&raster, &band)?;
        }
    }
    Ok(spill.expect("an image has a pixel"))
}

/// The samples of a PNG file in a scratch file, with its orientation. `None` for other files, and where the general
/// decoder has to read the file or to say what is wrong with it.
///
/// # Errors
/// [`Error::Write`] when `scratch` cannot be written.
fn unpacked_png(
    reader: Reader,
    path: &Path,
    scratch: &Path,
    kept: u64,
) -> Result<Option<(Spill, Orientation)>> {
    let file = on_disk(reader, path, Kind::Coded(ImageFormat::Png));
    let Some(mut png) = file.and_then(|file| Png::open(file, reader.max_pixels)) else { return Ok(None) };
    let (size, orientation) = (png.size, png.orientation);
    if (png.row_bytes() * size.1) as u64 <= kept {
        return Ok(None);
    }
    let mut spill: Option<Spill> = None;
    for piece in bands(size) {
        let rows = png.rows(piece.y.len()).map(|rows| match reader.no_data {
            Some(value) => rows.marked(value).ok(),
            None => Some(rows),
        });
        let Some(rows) = rows.flatten() else { return Ok(None) };
        let spill = match &mut spill {
            Some(spill) => spill,
            none => none.insert(Spill::new(scratch, size, &rows)?),
        };
        spill.write(&rows, &piece)?;
    }
    Ok(spill.filter(|_| png.ends_soundly()).map(|spill| (spill, orientation)))
}

/// Bands of rows of about [`PIECE`] pixels that cover an image.
fn bands((width, height): (usize, usize)) -> impl Iterator<Item = Rect> {
    let rows = (PIECE / width).max(1);
    (0..height).step_by(rows).map(move |y| Rect { x: 0..width, y: y..(y + rows).min(height) })
}

/// (width, height) by the header of a file.
///
/// # Errors
/// The errors of [`Reader::raster`], except for damaged pixels.
pub(super) fn size(reader: Reader, path: &Path) -> Result<(usize, usize)> {
    let turned = |size, tag: Orientation| if reader.orient { tag.turned(size) } else { size };
    if let Some((_, image)) = tiff_on_disk(reader, path)? {
        return Ok(turned(image.size(), image.orientation));
    }
    // The start is enough for all but odd files, and any error is that of the whole file.
    if let Some((start, length)) = start_of(reader, path)
        && let Ok(Some((size, tag))) = decode::size(&start, reader.max_pixels, length)
    {
        return Ok(turned(size, tag));
    }
    let bytes = load(path, reader.max_pixels)?;
    let size = decode::size(&bytes, reader.max_pixels, bytes.len() as u64);
    match size.map_err(|cause| Error::read(path, cause))? {
        Some((size, tag)) => Ok(turned(size, tag)),
        None => Ok(reader.raster_in_memory(path, &bytes)?.size()),
    }
}

/// The first bytes of a file that is not too large, and the length of all.
fn start_of(reader: Reader, path: &Path) -> Option<(Vec<u8>, u64)> {
    let file = Disk::open(path).ok()??;
    let length = file.len();
    (length <= max_bytes_of(reader.max_pixels)).then_some(())?;
    Some((file.read(0, length.min(HEADER)).ok()?, length))
}
