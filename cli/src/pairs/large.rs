//! Pairs that are read by windows.

use std::cell::OnceCell;
use std::path::{Path, PathBuf};

use mrfgs::check::{self, Warning};
use mrfgs::image::read::Reader;
use mrfgs::image::windows::{Overview, PairWindows};
use mrfgs::image::{Georeference, Pair, Rect};
use mrfgs::options::{DisparityRange, Method};
use mrfgs::{Error, Result};

use crate::pairs::views::Views;

/// The files of a rectified pair, and how to read them.
#[derive(Clone, Copy)]
pub(crate) struct PairFiles<'a> {
    pub(crate) reader: Reader,
    pub(crate) left: &'a Path,
    pub(crate) right: &'a Path,
    pub(crate) mask: Option<&'a Path>,
}

impl PairFiles<'_> {
    /// Opens them, with the folder `scratch` for what has to be unpacked.
    pub(crate) fn open(&self, scratch: &Path) -> Result<PairWindows> {
        self.reader.windows(self.left, self.right, self.mask, scratch)
    }

    /// (width, height) of both images, by their headers.
    fn size(&self) -> Result<(usize, usize)> {
        let [left, right] = [self.left, self.right].map(|path| self.reader.size(path));
        let (left, right) = (left?, right?);
        if left == right {
            return Ok(left);
        }
        Err(Error::Mismatch(format!(
            "{} is {} x {} and {} is {} x {}: both images must have the same size",
            self.left.display(),
            left.0,
            left.1,
            self.right.display(),
            right.0,
            right.1
        )))
    }
}

/// The pixels of a pair.
enum Pixels {
    /// A pair that had to be read whole.
    Whole(Pair),
    Files(Box<PairWindows>),
}

/// A pair that is read by windows. What concerns all of it comes from an overview, which is read on first use.
pub(crate) struct LargePair {
    pixels: Pixels,
    /// Its memory limits the overview.
    method: Method,
    overview: OnceCell<Overview>,
    /// The range, if it is known already.
    range: Option<DisparityRange>,
}

impl LargePair {
    fn new(pixels: Pixels, method: &Method) -> Self {
        Self { pixels, method: method.clone(), overview: OnceCell::new(), range: None }
    }

    /// The pair in `windows`, with the memory of `method`.
    pub(crate) fn of_files(windows: PairWindows, method: &Method) -> Self {
        Self::new(Pixels::Files(Box::new(windows)), method)
    }

    /// A pair that is in memory.
    pub(crate) fn of_pair(pair: Pair, method: &Method) -> Self {
        Self::new(Pixels::Whole(pair), method)
    }

    /// The same pair, whose `range` sparse matches have found before, if known.
    pub(crate) fn with_range(self, range: Option<DisparityRange>) -> Self {
        Self { range, ..self }
    }

    /// The pixels of `part`.
    pub(crate) fn window(&self, part: &Rect) -> Result<Pair> {
        match &self.pixels {
            Pixels::Whole(pair) => Ok(pair.crop(part)),
            Pixels::Files(windows) => windows.window(part),
        }
    }

    /// The georeferences of both views.
    pub(crate) fn georeferences(&self) -> [Option<Georeference>; 2] {
        match &self.pixels {
            Pixels::Whole(pair) => pair.georeferences(),
            Pixels::Files(windows) => windows.georeferences(),
        }
    }

    fn overview(&self) -> Result<&Overview> {
        if let Some(overview) = self.overview.get() {
            return Ok(overview);
        }
        let overview = match &self.pixels {
            Pixels::Whole(pair) => Overview { pair: pair.clone(), factor: 1 },
            Pixels::Files(windows) => check::overview(windows, &self.method)?,
        };
        Ok(self.overview.get_or_init(|| overview))
    }

    /// Frees the overview.
    pub(crate) fn forget_overview(&mut self) {
        self.overview.take();
    }

    /// Warnings about the pair, from its overview; `range` is that of the user, if there is one.
    pub(crate) fn warnings(&self, range: Option<DisparityRange>) -> Result<Vec<Warning>> {
        Ok(check::warnings_of_overview(self.overview()?, range))
    }
}

/// The range comes from the overview.
impl Views for LargePair {
    fn size(&self) -> (usize, usize) {
        match &self.pixels {
            Pixels::Whole(pair) => pair.size(),
            Pixels::Files(windows) => windows.size(),
        }
    }

    fn range(&self, doffs: Option<f64>) -> Result<DisparityRange> {
        if let Some(range) = self.range {
            return Ok(range);
        }
        check::range_of_overview(self.overview()?, doffs)
    }
}

/// A pair that is read only if its range has to be found.
pub(crate) struct UnreadPair<'a> {
    files: PairFiles<'a>,
    method: &'a Method,
    scratch: PathBuf,
    size: (usize, usize),
}

impl<'a> UnreadPair<'a> {
    /// The pair in `files`, for a match by `method`, with the folder `scratch` for what has to be unpacked.
    pub(crate) fn new(files: PairFiles<'a>, method: &'a Method, scratch: PathBuf) -> Result<Self> {
        Ok(Self { files, method, scratch, size: files.size()? })
    }
}

impl Views for UnreadPair<'_> {
    fn size(&self) -> (usize, usize) {
        self.size
    }

    fn range(&self, doffs: Option<f64>) -> Result<DisparityRange> {
        LargePair::of_files(self.files.open(&self.scratch)?, self.method).range(doffs)
    }
}
