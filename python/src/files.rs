//! Pairs in files, of which parts are read.

use std::path::{self, Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::{env, fs, process};

use mrfgs::image::read::{MAX_PIXELS, Reader};
use mrfgs::image::windows::PairWindows;
use mrfgs::image::{Pair, Rect};
use mrfgs::low_level::process::Own;
use mrfgs::{Error, SharedMatcher};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays::{self, Stored};
use crate::exceptions::{self, exception};

/// Most things of one kind that a process keeps open because they may arrive again.
const KEPT: usize = 4;

/// The files of a pair: their paths, mask, no-data value, orientation, pixel limit and scratch folder; the bytes of each file; and the size
/// of the pair.
pub(crate) type FilesState = (
    (PathBuf, PathBuf, Option<PathBuf>, Option<f64>, bool, u64, Option<PathBuf>),
    (u64, u64, Option<u64>),
    (usize, usize),
);

/// What a process has opened: nothing before the first use.
type Opened = Arc<Own<Mutex<Option<Arc<PairWindows>>>>>;

/// A pair in files. Each process opens them for itself, on first use.
pub(crate) struct PairFiles {
    /// Absolute, as a worker may have another current folder.
    paths: [PathBuf; 2],
    mask: Option<PathBuf>,
    reader: Reader,
    scratch: Option<PathBuf>,
    /// The bytes of each file, by which changed files are found.
    lengths: (u64, u64, Option<u64>),
    size: (usize, usize),
    /// Locked only while Python is, so that a fork never finds it locked.
    opened: Mutex<Opened>,
}

/// The arguments of a pair in files.
pub(crate) struct FilesGiven<'a, 'py> {
    pub(crate) views: [&'a Bound<'py, PyAny>; 2],
    pub(crate) mask: Option<&'a Bound<'py, PyAny>>,
    pub(crate) no_data: Option<f64>,
    pub(crate) orient: bool,
    pub(crate) max_pixels: Option<u64>,
    pub(crate) scratch: Option<&'a Bound<'py, PyAny>>,
}

impl PairFiles {
    /// Notes the files; they are opened on first use.
    pub(crate) fn new(given: &FilesGiven) -> PyResult<Self> {
        let [left, right] =
            [("left", given.views[0]), ("right", given.views[1])].map(|(name, view)| absolute(name, view));
        let (left, right) = (left?, right?);
        let mask = given.mask.map(|mask| absolute("mask", mask)).transpose()?;
        let scratch = given.scratch.map(|scratch| absolute("scratch", scratch)).transpose()?;
        let max_pixels = given.max_pixels.unwrap_or(MAX_PIXELS);
        let reader = Reader { max_pixels, no_data: given.no_data, orient: given.orient };
        let length = |path: &Path| length(path).map_err(exception);
        let lengths = (length(&left)?, length(&right)?, mask.as_deref().map(length).transpose()?);
        let size = reader.size(&left).map_err(exception)?;
        Ok(Self { paths: [left, right], mask, reader, scratch, lengths, size, opened: Mutex::new(nothing()) })
    }

    /// The same files where they arrive.
    pub(crate) fn of_state((files, lengths, size): FilesState) -> Self {
        let (left, right, mask, no_data, orient, max_pixels, scratch) = files;
        let reader = Reader { max_pixels, no_data, orient };
        Self { paths: [left, right], mask, reader, scratch, lengths, size, opened: Mutex::new(nothing()) }
    }

    pub(crate) fn state(&self) -> FilesState {
        let Reader { no_data, orient, max_pixels } = self.reader;
        let [left, right] = self.paths.clone();
        (
            (left, right, self.mask.clone(), no_data, orient, max_pixels, self.scratch.clone()),
            self.lengths,
            self.size,
        )
    }

    /// (width, height) of both images in pixels.
    pub(crate) fn size(&self) -> (usize, usize) {
        self.size
    }

    /// What this process has opened. Needs Python, so that nobody forks meanwhile.
    pub(crate) fn opened(&self, _py: Python) -> OpenFiles<'_> {
        let mut opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        if opened.get().is_none() {
            *opened = nothing();
        }
        OpenFiles { files: self, opened: Arc::clone(&opened) }
    }

    /// Opens the files.
    fn open(&self) -> mrfgs::Result<PairWindows> {
        let views = self.paths.iter().map(PathBuf::as_path).zip([self.lengths.0, self.lengths.1]);
        let changed = |path: &Path| {
            Error::Mismatch(format!("{} has changed since it was first opened; start again", path.display()))
        };
        for (path, bytes) in views.chain(self.mask.as_deref().zip(self.lengths.2)) {
            if length(path)? != bytes {
                return Err(changed(path));
            }
        }
        let [left, right] = &self.paths;
        let scratch = self.scratch.clone().unwrap_or_else(env::temp_dir);
        let windows = self.reader.windows(left, right, self.mask.as_deref(), &scratch)?;
        if windows.size() == self.size { Ok(windows) } else { Err(changed(left)) }
    }
}

/// The files of a pair as this process has them open.
pub(crate) struct OpenFiles<'a> {
    files: &'a PairFiles,
    opened: Opened,
}

impl OpenFiles<'_> {
    /// The windows of the pair, opened by the first thread that asks, on the threads of `matcher` if there is one. The calling thread must
    /// be none of those: it could wait for itself.
    ///
    /// # Errors
    /// Those of [`Reader::windows`], and about files that have changed.
    pub(crate) fn windows(&self, matcher: Option<&SharedMatcher>) -> mrfgs::Result<Arc<PairWindows>> {
        let place = self.opened.get().expect("it is of this process");
        let mut windows = place.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(windows) = &*windows {
            return Ok(Arc::clone(windows));
        }
        let open = || self.files.open();
        let opened = match matcher {
            Some(matcher) => matcher.share_of(self.files.size, open)??,
            None => open()?,
        };
        Ok(Arc::clone(windows.insert(Arc::new(opened))))
    }
}

fn nothing() -> Opened {
    Arc::new(Own::new(Mutex::new(None)))
}

/// Number of bytes of a file, which is no pipe, as it is read several times.
fn length(path: &Path) -> mrfgs::Result<u64> {
    let found = fs::metadata(path).map_err(|e| Error::read(path, e))?;
    if found.is_file() {
        Ok(found.len())
    } else {
        Err(Error::read(path, "it is a folder or a pipe; give a file"))
    }
}

/// The argument `name` as an absolute path.
fn absolute(name: &str, given: &Bound<PyAny>) -> PyResult<PathBuf> {
    let given: PathBuf = given.extract().map_err(|error| {
        let reason = format!("{name}: give the path of a file; arrays are matched by mrfgs.match");
        exceptions::instead(given.py(), error, PyTypeError::new_err(reason))
    })?;
    path::absolute(&given).map_err(|error| PyValueError::new_err(format!("{name}: {error}")))
}

/// The thing with this state that has arrived in this process before, or a new one by `make`. The last few are kept for the next copy.
pub(crate) fn arrived<'py, T: pyo3::PyClass>(
    cache: &PyOnceLock<Py<PyDict>>,
    state: Bound<'py, PyTuple>,
    make: impl FnOnce() -> PyResult<Bound<'py, T>>,
) -> PyResult<Bound<'py, T>> {
    let py = state.py();
    let kept = cache.get_or_init(py, || PyDict::new(py).unbind()).bind(py);
    let key = (process::id(), state);
    let known = kept.get_item(&key)?;
    let thing = match known {
        Some(known) => known.cast_into()?,
        None => make()?,
    };
    // The last one comes last.
    kept.call_method1("pop", (&key, py.None()))?;
    kept.set_item(&key, &thing)?;
    while kept.len() > KEPT {
        let Some(oldest) = kept.keys().iter().next() else { break };
        kept.call_method1("pop", (oldest, py.None()))?;
    }
    Ok(thing)
}

static ARRIVED: PyOnceLock<Py<PyDict>> = PyOnceLock::new();

/// A rectified pair in files, of which windows are read, in the memory of a window.
///
/// left, right: the files, of any kind that `read_image` reads. Of TIFF files, only the strips and tiles of a window are decoded. Other
///     files are unpacked once for each process: into memory, or into a file in `scratch` above 64 MiB.
/// mask: the file of a mask: pixels of the left image where it is not black are masked.
/// no_data: a value for no data: pixels that have it in every channel are masked, in both images.
/// orient: whether to rotate both upright according to their EXIF or TIFF orientation tag.
/// max_pixels: the most pixels that an image may have, 268 million by default.
/// scratch: the folder for unpacked files, by default the system's folder for temporary files where the pair is opened.
///
/// It can be pickled, and opens the files again where it arrives: once for each process. Raises ValueError if the images do not fit
/// together or are damaged, and FileNotFoundError if one does not exist.
#[pyclass(name = "PairWindows", frozen, module = "mrfgs")]
pub(crate) struct PyPairWindows(PairFiles);

#[pymethods]
impl PyPairWindows {
    #[new]
    #[pyo3(signature = (left, right, mask=None, *, no_data=None, orient=false, max_pixels=None, scratch=None))]
    #[allow(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        py: Python,
        left: &Bound<PyAny>,
        right: &Bound<PyAny>,
        mask: Option<&Bound<PyAny>>,
        no_data: Option<f64>,
        orient: bool,
        max_pixels: Option<u64>,
        scratch: Option<&Bound<PyAny>>,
    ) -> PyResult<Self> {
        let files =
            PairFiles::new(&FilesGiven { views: [left, right], mask, no_data, orient, max_pixels, scratch })?;
        let opened = files.opened(py);
        py.detach(|| opened.windows(None)).map_err(exception)?;
        py.check_signals()?;
        Ok(Self(files))
    }

    /// Supports `pickle` and `copy`.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, FilesState)> {
        Ok((py.get_type::<Self>().getattr("_arrived")?, self.0.state()))
    }

    #[staticmethod]
    #[pyo3(signature = (*state))]
    fn _arrived<'py>(py: Python<'py>, state: Bound<'py, PyTuple>) -> PyResult<Bound<'py, Self>> {
        let files: FilesState = state.extract()?;
        arrived(&ARRIVED, state, || Bound::new(py, Self(PairFiles::of_state(files))))
    }

    /// (width, height) of both images, in pixels.
    #[getter]
    fn size(&self) -> (usize, usize) {
        self.0.size()
    }

    /// Reads a part of both images, for `match`.
    ///
    /// x, y, width, height: first column, first row and size of the part in pixels.
    ///
    /// Returns (left, right), masked arrays of shape (height, width, 3), RGB: uint8 for images of 8 bits, else uint16 with the levels of
    /// the whole pair, so that windows of it look alike. Raises ValueError if the part is not inside the images or a file is damaged there.
    fn window<'py>(
        &self,
        py: Python<'py>,
        x: usize,
        y: usize,
        width: usize,
        height: usize,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let part = Rect { x: x..x.saturating_add(width), y: y..y.saturating_add(height) };
        let opened = self.0.opened(py);
        let pair = py.detach(|| opened.windows(None)?.window(&part)).map_err(exception)?;
        py.check_signals()?;
        views(py, &pair)
    }

    fn __repr__(&self) -> String {
        let (width, height) = self.0.size();
        format!("<mrfgs.PairWindows: {width} x {height}>")
    }
}

/// Both views as arrays of three channels that `match` reads as they are.
fn views<'py>(py: Python<'py>, pair: &Pair) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let bytes = [pair.left(), pair.right()]
        .iter()
        .all(|image| image.pixels.data().iter().all(|pixel| pixel.iter().all(|v| v % 256 == 0)));
    let [left, right] = arrays::images(py, pair, [Stored::colours(bytes); 2])?;
    Ok((left, right))
}
