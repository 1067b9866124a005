//! Decoded samples in a scratch file.

use std::path::{Path, PathBuf};

use bytemuck::Pod;

use crate::error::{Error, Result};
use crate::image::Rect;
use crate::image::disk::Disk;
use crate::image::raster::{Raster, Sample, Samples, of_any};
use crate::memory;

/// An image in a file without a name: its samples row by row, and behind them a byte for each pixel that says whether it
/// holds no data, if the image has that.
pub(super) struct Spill {
    file: Disk,
    /// The folder that the file is in.
    scratch: PathBuf,
    width: usize,
    height: usize,
    channels: usize,
    /// No samples, of the type of the image's.
    none: Samples<'static>,
    has_no_data: bool,
}

impl Spill {
    /// An empty file in `scratch` for an image of `size`, with channels and samples like those of `part`, a part of it.
    ///
    /// # Errors
    /// [`Error::Write`] when there can be no file in `scratch`.
    pub(super) fn new(scratch: &Path, size: (usize, usize), part: &Raster) -> Result<Self> {
        let file = tempfile::tempfile_in(scratch).map_err(|e| Error::write(scratch, e))?;
        Ok(Self::within(Disk::empty(file), scratch, size, part))
    }

    /// Like [`Spill::new`], in this file.
    fn within(file: Disk, scratch: &Path, (width, height): (usize, usize), part: &Raster) -> Self {
        fn none<S: Sample>(_: &[S]) -> Samples<'static> {
            S::samples(Vec::new().into())
        }
        Self {
            file,
            scratch: scratch.to_owned(),
            width,
            height,
            channels: part.channels,
            none: of_any!(&part.samples, v => none(v)),
            has_no_data: part.no_data.is_some(),
        }
    }

    /// (width, height) in pixels.
    pub(super) fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Whether its samples are floats.
    pub(super) fn is_float(&self) -> bool {
        self.none.is_float()
    }

    /// Whether its samples are of 8 bits.
    pub(super) fn holds_bytes(&self) -> bool {
        matches!(self.none, Samples::Byte(_))
    }

    /// Writes the `part` of the image that `raster` is.
    ///
    /// # Errors
    /// [`Error::Write`] when the disk is full, for one.
    pub(super) fn write(&mut self, raster: &Raster, part: &Rect) -> Result<()> {
        of_any!(&raster.samples, v => self.write_rows(0, v, self.channels, part))?;
        match &raster.no_data {
            Some(marked) => self.write_rows(self.marks(), marked, 1, part),
            None => Ok(()),
        }
    }

    /// The pixels in `part`.
    ///
    /// # Errors
    /// [`Error::Read`] when the scratch file cannot be read, and errors about memory.
    pub(super) fn part(&self, part: &Rect) -> Result<Raster<'static>> {
        let samples = of_any!(&self.none, none => self.samples(none, part)?);
        let no_data = self.has_no_data.then(|| self.rows::<u8>(self.marks(), 1, part)).transpose()?;
        let no_data = no_data.map(|marks| marks.into_iter().map(|mark| mark != 0).collect());
        Ok(Raster { no_data, ..Raster::of(part.size(), self.channels, samples) })
    }

    /// The position of the bytes of pixels without data.
    fn marks(&self) -> u64 {
        let size = of_any!(&self.none, none => size_of_each(none));
        self.width as u64 * self.height as u64 * (self.channels * size) as u64
    }

    fn samples<S: Sample + Pod>(&self, _: &[S], part: &Rect) -> Result<Samples<'static>> {
        Ok(S::samples(self.rows::<S>(0, self.channels, part)?.into()))
    }

    /// The values in `part` of a plane at `start` with `each` values for each pixel.
    fn rows<S: Pod>(&self, start: u64, each: usize, part: &Rect) -> Result<Vec<S>> {
        let row = part.x.len() * each;
        let mut out = memory::filled(row * part.y.len(), S::zeroed())?;
        for (run, values) in self.runs(part).zip(out.chunks_mut(self.run_rows(part) * row)) {
            let at = start + run * (each * size_of::<S>()) as u64;
            self.file
                .fill(bytemuck::cast_slice_mut(values), at)
                .map_err(|e| Error::read(&self.scratch, e))?;
        }
        Ok(out)
    }

    fn write_rows<S: bytemuck::NoUninit>(
        &mut self,
        start: u64,
        values: &[S],
        each: usize,
        part: &Rect,
    ) -> Result<()> {
        let length = self.run_rows(part) * part.x.len() * each;
        let runs: Vec<u64> = self.runs(part).collect();
        for (run, values) in runs.into_iter().zip(values.chunks(length)) {
            let at = start + run * (each * size_of::<S>()) as u64;
            let written = self.file.write(bytemuck::cast_slice(values), at);
            written.map_err(|e| Error::write(&self.scratch, e))?;
        }
        Ok(())
    }

    /// Rows of `part` that lie next to each other in the file.
    fn run_rows(&self, part: &Rect) -> usize {
        if part.x.len() == self.width { part.y.len() } else { 1 }
    }

    /// The first pixel of each run of [`run_rows`](Self::run_rows).
    fn runs(&self, part: &Rect) -> impl Iterator<Item = u64> {
        let (width, left) = (self.width as u64, part.x.start as u64);
        part.y.clone().step_by(self.run_rows(part)).map(move |y| y as u64 * width + left)
    }
}

fn size_of_each<S>(_: &[S]) -> usize {
    size_of::<S>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A full disk is told with the name of the folder.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_an_error_with_the_folder() {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let raster = Raster::of((2, 2), 1, Samples::Byte(vec![1; 4].into()));
        let scratch = Path::new("some/folder");
        let mut spill = Spill::within(Disk::empty(full), scratch, (2, 2), &raster);
        let said = spill.write(&raster, &Rect::whole((2, 2))).unwrap_err().to_string();
        assert!(said.starts_with("cannot write some/folder: ") && !said.contains('\n'), "{said}");
        assert!(said.to_lowercase().contains("space"), "{said}");
    }
}
