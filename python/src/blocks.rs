//! Large pairs in blocks.

use mrfgs::Conditioning;
use mrfgs::check::{self, Warning};
use mrfgs::image::Rect;
use mrfgs::image::windows::PairWindows;
use mrfgs::options::{DisparityRange, Method};
use mrfgs::region::{Blocks, Region};
use pyo3::exceptions::{PyIndexError, PyRuntimeError, PyTypeError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyTuple};

use crate::exceptions::{self, exception};
use crate::files::{self, FilesGiven, FilesState, PairFiles};
use crate::matched::PyMatched;
use crate::matcher::{PyMatcher, Recipe, interruptible, recipe};
use crate::{options, range};

/// The version of the package, which determines the maps.
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// How the blocks are matched: the range, the method in TOML, the corrections (row offset, smoothing of both views), and the matcher.
type MatchState = ((i32, i32), String, (i32, f64, f64), Recipe);

/// A pickle: the version, the files, and how the blocks are matched.
type State = (String, FilesState, MatchState);

/// The blocks that have arrived by pickle.
static ARRIVED: PyOnceLock<Py<PyDict>> = PyOnceLock::new();

/// A rectified pair in files that is matched block by block, as the program does with --blocks: for pairs that are larger than memory, or
/// shared by several processes or machines.
///
/// len(blocks) is the number of blocks. Their parts cover the left image, each pixel once; joined, their maps have the same bytes as those
/// of `mrfgs match --blocks` with the same arguments, on every device and in any order.
///
/// left, right: the files, of any kind that `read_image` reads. Of TIFF files, only the strips and tiles of a block are decoded. Other
///     files are unpacked once for each process: into memory, or into a file in `scratch` above 64 MiB.
/// max_disparity, min_disparity: the range to search, as for `Matcher.match`. Without max_disparity it is found in a smaller copy of the
///     pair.
/// mask: the file of a mask: pixels of the left image where it is not black are ignored.
/// no_data: a value for no data: pixels that have it in every channel are ignored, in both images.
/// orient: whether to rotate both upright according to their EXIF or TIFF orientation tag.
/// max_pixels: the most pixels that an image may have, 268 million by default.
/// scratch: the folder for unpacked files, by default the system's folder for temporary files where the pair is opened.
/// method, options, memory: as for `Matcher.match`; smaller memory makes smaller blocks. Blocks have at most about 4096 x 4096 pixels.
/// warn: whether to check a smaller copy of the pair for probable faults, and issue a MatchWarning.
/// device, threads: as for `Matcher`, for each process that matches blocks.
///
/// Making it measures what all blocks have in common: the range, if it is to be found, and what is corrected in the pair. Pickled, it keeps
/// that, and opens files and device where it arrives: once for each process, and the device for its first block. So the files must be there
/// under the same absolute paths, unchanged.
///
/// Raises ValueError for invalid arguments and damaged files, and if `memory` is too small for a block, TypeError for arrays,
/// FileNotFoundError if a file does not exist, and MemoryError if the machine has too little memory.
#[pyclass(name = "Blocks", frozen, module = "mrfgs")]
pub(crate) struct PyBlocks {
    files: PairFiles,
    range: DisparityRange,
    method: Method,
    conditioning: Conditioning,
    recipe: Recipe,
    blocks: Blocks,
}

#[pymethods]
impl PyBlocks {
    #[new]
    #[pyo3(signature = (left, right, max_disparity=None, *, min_disparity=None, mask=None, no_data=None, orient=false, max_pixels=None,
                        scratch=None, method=None, options=None, memory=None, warn=true, device=None, threads=None))]
    #[allow(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        py: Python,
        left: &Bound<PyAny>,
        right: &Bound<PyAny>,
        max_disparity: Option<&Bound<PyAny>>,
        min_disparity: Option<&Bound<PyAny>>,
        mask: Option<&Bound<PyAny>>,
        no_data: Option<f64>,
        orient: bool,
        max_pixels: Option<u64>,
        scratch: Option<&Bound<PyAny>>,
        method: Option<&Bound<PyAny>>,
        options: Option<&Bound<PyAny>>,
        memory: Option<&Bound<PyAny>>,
        warn: bool,
        device: Option<&Bound<PyAny>>,
        threads: Option<&Bound<PyAny>>,
    ) -> PyResult<Self> {
        let method = options::method(method, options, memory)?;
        let recipe = recipe(&options::execution(device, threads)?);
        let matcher = PyMatcher::of_process(py, recipe.clone())?.matcher;
        let min = range::pixels("min_disparity", min_disparity)?;
        let given = range::given(range::pixels("max_disparity", max_disparity)?, min)?;
        let files =
            PairFiles::new(&FilesGiven { views: [left, right], mask, no_data, orient, max_pixels, scratch })?;
        // Refuses too little memory before the files are read.
        if let Some(range) = given {
            Blocks::new(files.size(), range, &method).map_err(exception)?;
        }
        let opened = files.opened(py);
        let measure = || {
            let windows = opened.windows(Some(&matcher))?;
            matcher.share_of(files.size(), || Common::measured(&windows, given, min, &method, warn))?
        };
        let Common { range, blocks, conditioning, warnings } = py.detach(measure).map_err(exception)?;
        py.check_signals()?;
        exceptions::warn(py, warnings)?;
        Ok(Self { files, range, method, conditioning, recipe, blocks })
    }

    /// Supports `pickle` and `copy`.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, State)> {
        let Conditioning { offset, smoothing: [left, right], .. } = self.conditioning;
        let range = (self.range.min, self.range.max);
        let state = (range, self.method.table().to_string(), (offset, left, right), self.recipe.clone());
        Ok((py.get_type::<Self>().getattr("_arrived")?, (VERSION.to_owned(), self.files.state(), state)))
    }

    #[staticmethod]
    #[pyo3(signature = (*state))]
    fn _arrived<'py>(py: Python<'py>, state: Bound<'py, PyTuple>) -> PyResult<Bound<'py, Self>> {
        let (version, files, matching): State = state.extract()?;
        if version != VERSION {
            return Err(PyRuntimeError::new_err(format!(
                "these blocks come from mrfgs {version}, and this is {VERSION}, whose maps may differ; install the same version everywhere"
            )));
        }
        files::arrived(&ARRIVED, state, || {
            let ((min, max), method, (offset, left, right), recipe) = matching;
            let method = method.parse::<toml::Table>().and_then(toml::Table::try_into::<Method>);
            let method =
                method.map_err(|error| PyTypeError::new_err(format!("these blocks are damaged: {error}")))?;
            let range = DisparityRange { min, max };
            let files = PairFiles::of_state(files);
            let blocks = Blocks::new(files.size(), range, &method).map_err(exception)?;
            let mut conditioning = Conditioning::default();
            (conditioning.offset, conditioning.smoothing) = (offset, [left, right]);
            Bound::new(py, Self { files, range, method, conditioning, recipe, blocks })
        })
    }

    fn __len__(&self) -> usize {
        self.blocks.list().len()
    }

    /// (width, height) of the whole map, in pixels.
    #[getter]
    fn size(&self) -> (usize, usize) {
        self.blocks.size()
    }

    /// Smallest disparity to search, in pixels.
    #[getter]
    fn min_disparity(&self) -> i32 {
        self.range.min
    }

    /// Largest disparity to search, in pixels.
    #[getter]
    fn max_disparity(&self) -> i32 {
        self.range.max
    }

    /// The part of the left image that a block covers: (x, y, width, height) in pixels. Rig.of_part takes its x and y.
    ///
    /// index: the block, from 0 at the top left, row by row. Raises IndexError for others.
    fn part(&self, index: usize) -> PyResult<(usize, usize, usize, usize)> {
        let Rect { x, y } = self.block(index)?.part();
        Ok((x.start, y.start, x.len(), y.len()))
    }

    /// Matches a block, and returns the maps of its part as a Matched, of shape (height, width).
    ///
    /// index: the block, from 0 at the top left, row by row.
    ///
    /// Threads may share the blocks; their matches take turns. Other threads keep running, and Ctrl-C interrupts it. Raises IndexError
    /// without such a block, ValueError if a file is damaged there or has changed, RuntimeError if the device fails, and MemoryError.
    #[pyo3(name = "match")]
    fn run(&self, py: Python, index: usize) -> PyResult<PyMatched> {
        let block = self.block(index)?;
        let shared = PyMatcher::of_process(py, self.recipe.clone())?;
        shared.check()?;
        let (matcher, opened) = (&shared.matcher, self.files.opened(py));
        let matched = py.detach(|| {
            interruptible(|stop| {
                let windows = opened.windows(Some(matcher))?;
                let window = block.window();
                let pair = matcher.share_of(window.size(), || windows.window(window))??;
                let mut matched = matcher.turn(|matcher| {
                    let job = matcher.job(&pair, self.range).method(&self.method);
                    job.conditioning(self.conditioning).cancel(stop).run()
                })?;
                matched.maps = block.maps_of(&matched.maps);
                Ok(matched)
            })
        })?;
        PyMatched::of(py, matched)
    }

    fn __repr__(&self) -> String {
        let ((width, height), count, DisparityRange { min, max }) = (self.size(), self.__len__(), self.range);
        format!("<mrfgs.Blocks: {count} of {width} x {height}, disparities {min} to {max}>")
    }
}

impl PyBlocks {
    fn block(&self, index: usize) -> PyResult<&Region> {
        let list = self.blocks.list();
        list.get(index).ok_or_else(|| {
            let count = list.len();
            PyIndexError::new_err(format!(
                "block {index}: give one of the {count} blocks, 0 to {}",
                count - 1
            ))
        })
    }
}

/// What all blocks of a pair have in common.
struct Common {
    range: DisparityRange,
    blocks: Blocks,
    conditioning: Conditioning,
    warnings: Vec<Warning>,
}

impl Common {
    /// Measures it on the pair in `windows`; `given` is the range of the user, if there is one, and `min` its lower end.
    fn measured(
        windows: &PairWindows,
        given: Option<DisparityRange>,
        min: Option<i32>,
        method: &Method,
        warn: bool,
    ) -> mrfgs::Result<Self> {
        let overview = (warn || given.is_none()).then(|| check::overview(windows, method)).transpose()?;
        let range = match (given, &overview) {
            (None, Some(overview)) => {
                let found = check::range_of_overview(overview, None)?;
                DisparityRange::new(min.unwrap_or(found.min), found.max)?
            }
            (given, _) => given.expect("without a range there is an overview"),
        };
        let warnings =
            overview.filter(|_| warn).map(|overview| check::warnings_of_overview(&overview, given));
        let blocks = Blocks::new(windows.size(), range, method)?;
        let conditioning = blocks.conditioning(|part| windows.window(part))?;
        Ok(Self { range, blocks, conditioning, warnings: warnings.unwrap_or_default() })
    }
}
