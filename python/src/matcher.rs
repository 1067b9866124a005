//! The matcher.

use std::process;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;

use mrfgs::image::Rect;
use mrfgs::options::{DeviceChoice, DisparityRange, Execution};
use mrfgs::region::Region;
use mrfgs::{AutoRange, Matched, Matcher, Pair, SharedMatcher, check};
use pyo3::exceptions::{PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyDict;

use crate::arrays::{self, Image};
use crate::exceptions::{self, exception};
use crate::matched::PyMatched;
use crate::sequence::{PATIENCE, PyMatchedSequence, Settings, Shared};
use crate::{options, prior, range};

/// Matches pairs, keeping the device, its compiled shaders and its buffers in between.
///
/// device: "auto", the default, uses a GPU if there is one, else the CPU; "cpu" uses the CPU; "gpu" uses a GPU or any Vulkan or Metal
///     driver, and raises RuntimeError without one; anything else is the index of a device, such as 0, or part of its name, as listed by
///     `mrfgs devices`. The maps are bit for bit the same.
/// threads: maximum number of CPU threads of a match and its checks, 1 to 1024. The default is the number of processors available to the
///     process (affinity, cgroups), or the smallest of RAYON_NUM_THREADS, OMP_NUM_THREADS, SLURM_CPUS_PER_TASK and SLURM_CPUS_ON_NODE if
///     lower.
///
/// Threads may share a Matcher; their matches take turns. A forked process may use its parent's Matcher on the CPU, but not devices: there
/// "auto" uses the CPU, as Matched.note says, and "gpu" raises RuntimeError; start processes with "spawn" or "forkserver" instead.
///
/// A Matcher can be pickled, and so sent to workers. Where it arrives, it opens the device for its first match: one for each process,
/// however often it comes.
#[pyclass(name = "Matcher", frozen, module = "mrfgs")]
pub(crate) struct PyMatcher {
    shared: Shared,
    /// Opens it again in another process.
    recipe: Recipe,
}

/// The arguments of a Matcher: its device as a text, and its threads.
pub(crate) type Recipe = (String, Option<usize>);

/// The Matchers that have arrived by pickle: a dict from the process and the recipe.
static ARRIVED: PyOnceLock<Py<PyDict>> = PyOnceLock::new();

#[pymethods]
impl PyMatcher {
    #[new]
    #[pyo3(signature = (*, device=None, threads=None))]
    fn new(py: Python, device: Option<&Bound<PyAny>>, threads: Option<&Bound<PyAny>>) -> PyResult<Self> {
        Self::open(py, options::execution(device, threads)?)
    }

    /// Supports `pickle`.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Recipe)> {
        Ok((py.get_type::<Self>().getattr("_arrived")?, self.recipe.clone()))
    }

    #[staticmethod]
    fn _arrived<'py>(py: Python<'py>, device: String, threads: Option<usize>) -> PyResult<Bound<'py, Self>> {
        let arrived = ARRIVED.get_or_init(py, || PyDict::new(py).unbind()).bind(py);
        let recipe = (device, threads);
        let key = (process::id(), recipe.clone());
        if let Some(known) = arrived.get_item(&key)? {
            return Ok(known.cast_into()?);
        }
        let execution = Execution { device: (&*recipe.0).into(), threads, ..Execution::default() };
        let matcher = SharedMatcher::unopened(Matcher::builder().execution(execution)).map_err(exception)?;
        let made = Bound::new(py, Self { shared: Shared::new(matcher), recipe })?;
        // Another thread may have been faster.
        Ok(arrived.call_method1("setdefault", (key, made))?.cast_into()?)
    }

    /// Matches a rectified pair, and returns its maps as a Matched.
    ///
    /// left, right: arrays of shape (height, width) or (height, width, channels): grey, grey and alpha, RGB or RGBA, of uint8, uint16,
    ///     float32 or float64, in any layout. Left (x, y) with disparity d appears at right (x - d, y). 8 bits are used unchanged; 16 bits
    ///     are scaled by the largest value of both views; floats are scaled from the smallest to the largest value of both. If one view has
    ///     8 bits and the other 16, each is scaled on its own. Integers of other types, such as int64, count as 8 bits if all values of
    ///     both views are 0 to 255, and as 16 bits if they are 0 to 65535; others raise ValueError, as their meaning is unknown. Pixels
    ///     with alpha 0, non-finite values or a mask are ignored.
    /// max_disparity, min_disparity: the range to search in whole pixels, inclusive. Without max_disparity it is estimated from sparse
    ///     matches, and if the scene exceeds it the pair is matched again with half as many labels more; min_disparity defaults to 0 if
    ///     max_disparity is given.
    /// mask: array of shape (height, width): nonzero pixels of the left image are ignored, and invalid in the maps.
    /// no_data: a value for no data: pixels that have it in every channel are ignored, in both images.
    /// roi: (x, y, width, height) of a region of the left image in pixels; only that is matched, in proportionally less time, and the maps
    ///     have its size. Rig.of_part gives its depths and points.
    /// prior: disparities of the left image that are known: an array of its shape, +inf or NaN where nothing is known, or points as an array
    ///     of shape (n, 3) or (n, 4) with rows x, y, disparity and perhaps their standard deviation, all in pixels. Points with +inf or NaN
    ///     before it are left out. Rig.seen gives such rows for points of the scene.
    /// prior_sigma: the standard deviation of the prior in pixels, for all or as an array of the shape of the image; by default 0.25 for
    ///     points and 1 for surfaces.
    /// prior_kind: "points" are exact but sparse: they are cleaned and spread, and decide where no match can be trusted. A "surface" is
    ///     dense but coarse, and only shifts the balance between disparities. An array of the shape of the image counts as points if at
    ///     most a fifth of it is known.
    /// method: the name of a preset (see mrfgs.presets()), or the path of a TOML file that overrides keys of the preset "default"; the
    ///     default is that preset.
    /// options: options that override the method, such as {"fill": "none", "memory": 2048}; see mrfgs.options(). A key may include its
    ///     group, "refinement.fill", or a group may be a dict, {"refinement": {"fill": "none"}}.
    /// memory: memory limit of a match, such as "2GiB" or "512MiB"; a pair that needs more is matched in tiles. The default is that of the
    ///     method.
    /// warn: whether to check for probable faults (views swapped, turned, not rectified or of different scenes, a range that clips the
    ///     scene) and issue a MatchWarning. The check takes a fraction of the time of a match.
    ///
    /// Other threads keep running, and Ctrl-C interrupts it. Raises ValueError for invalid arguments, TypeError for unsupported arrays,
    /// RuntimeError if the selected device fails, and MemoryError if memory is too small.
    #[pyo3(
        name = "match",
        signature = (left, right, max_disparity=None, *, min_disparity=None, mask=None, no_data=None, roi=None, prior=None,
                     prior_sigma=None, prior_kind=None, method=None, options=None, memory=None, warn=true)
    )]
    #[allow(clippy::too_many_arguments, reason = "keywords in Python")]
    fn run(
        &self,
        py: Python,
        left: &Bound<PyAny>,
        right: &Bound<PyAny>,
        max_disparity: Option<&Bound<PyAny>>,
        min_disparity: Option<&Bound<PyAny>>,
        mask: Option<&Bound<PyAny>>,
        no_data: Option<f64>,
        roi: Option<&Bound<PyAny>>,
        prior: Option<&Bound<PyAny>>,
        prior_sigma: Option<&Bound<PyAny>>,
        prior_kind: Option<&str>,
        method: Option<&Bound<PyAny>>,
        options: Option<&Bound<PyAny>>,
        memory: Option<&Bound<PyAny>>,
        warn: bool,
    ) -> PyResult<PyMatched> {
        self.shared.check()?;
        let method = options::method(method, options, memory)?;
        let [left, right] = Image::both(left, right)?;
        let pair = arrays::pair(&left, &right, mask, no_data)?;
        let min_disparity = range::pixels("min_disparity", min_disparity)?;
        let given = range::given(range::pixels("max_disparity", max_disparity)?, min_disparity)?;
        let prior = prior::prior(pair.size(), prior, prior_sigma, prior_kind)?;
        let matcher = &self.shared.matcher;
        let range = range::searched(py, matcher, &pair, given, min_disparity)?;
        let part = roi.map(|roi| region(roi, &pair, range)).transpose()?;
        if warn {
            let seen = part.as_ref().map_or_else(|| pair.clone(), |part| part.window_of(&pair));
            let checked = py.detach(|| matcher.share(&seen, || check::warnings(&seen, given)));
            exceptions::warn(py, checked.map_err(exception)?)?;
        }
        let matched = py.detach(|| {
            interruptible(|stop| {
                matcher.turn(|matcher| {
                    let job = match given {
                        Some(range) => matcher.job(&pair, range),
                        None => matcher.job(&pair, AutoRange(range)),
                    };
                    let job = match &part {
                        Some(part) => job.region(part.part().clone()),
                        None => job,
                    };
                    let job = match &prior {
                        Some(prior) => job.prior(Arc::clone(prior)),
                        None => job,
                    };
                    job.method(&method).cancel(stop).run()
                })
            })
        })?;
        if warn {
            exceptions::warn(py, matched.warnings())?;
        }
        PyMatched::of(py, matched)
    }

    /// Matches pair after pair, and returns an iterator that yields a Matched for each, in order. On a device, uploading the next pair and
    /// downloading the last maps overlap with matching.
    ///
    /// pairs: an iterable of pairs (left, right) of arrays as for `match`, such as a list, a generator, or map(rectification.apply, lefts,
    ///     rights). Up to three pairs are in flight, so a result appears after two more pairs have been consumed. The arrays of a pair may
    ///     be reused for the next one. A third item is the prior of the pair: an array as for `match`, None, or a dict with the arguments
    ///     `prior`, `prior_sigma` and `prior_kind` of `match`.
    /// prior: "last", for cameras that stand still: the disparities measured in each frame are the prior of the next, unless that has one
    ///     of its own, so that maps flicker less. Frames then wait for each other.
    ///
    /// The pairs are frames of one pair of cameras. The automatic range and the warnings come from the first pair, and from the first one of
    /// another size. What is corrected in a pair (rows, focus, noise) is measured on every 30th. For pairs of different cameras or scenes
    /// give options={"measure-every": 1}: then each is treated as by `match`, but not matched again over a wider range.
    ///
    /// The other arguments are those of `match`, for all pairs; use masked arrays to ignore pixels. Pairs are consumed, and exceptions
    /// raised, in the thread that asks for results. An exception from `pairs`, or about an invalid pair, comes after the results of earlier
    /// pairs; messages number pairs from 0. Ctrl-C ends the sequence, as does `close()` of the iterator, which is automatic once nothing
    /// refers to it. Until then the Matcher raises RuntimeError for other matches.
    #[pyo3(signature = (pairs, max_disparity=None, *, min_disparity=None, no_data=None, prior=None, method=None, options=None, memory=None,
                        warn=true))]
    #[allow(clippy::too_many_arguments, reason = "keywords in Python")]
    fn match_all(
        &self,
        pairs: &Bound<PyAny>,
        max_disparity: Option<&Bound<PyAny>>,
        min_disparity: Option<&Bound<PyAny>>,
        no_data: Option<f64>,
        prior: Option<&Bound<PyAny>>,
        method: Option<&Bound<PyAny>>,
        options: Option<&Bound<PyAny>>,
        memory: Option<&Bound<PyAny>>,
        warn: bool,
    ) -> PyResult<PyMatchedSequence> {
        let follow = prior::follows(prior)?;
        let method = options::method(method, options, memory)?;
        let min_disparity = range::pixels("min_disparity", min_disparity)?;
        let range = range::given(range::pixels("max_disparity", max_disparity)?, min_disparity)?;
        let pairs = pairs.try_iter().map_err(|_| {
            PyTypeError::new_err("pairs: give an iterable of pairs of arrays, such as zip(lefts, rights)")
        })?;
        let settings = Settings { method, range, min_disparity, no_data, follow, warn };
        Ok(PyMatchedSequence::new(self.shared.clone(), settings, pairs))
    }
}

impl PyMatcher {
    fn open(py: Python, execution: Execution) -> PyResult<Self> {
        let recipe = recipe(&execution);
        let builder = Matcher::builder().execution(execution);
        let matcher = py.detach(|| SharedMatcher::new(builder)).map_err(exception)?;
        // Opening a device takes a while.
        py.check_signals()?;
        Ok(Self { shared: Shared::new(matcher), recipe })
    }

    /// The matcher of this process for `recipe`, which opens the device for its first match.
    pub(crate) fn of_process(py: Python, (device, threads): Recipe) -> PyResult<Shared> {
        Ok(Self::_arrived(py, device, threads)?.get().shared.clone())
    }
}

/// The arguments of a Matcher for `execution`.
pub(crate) fn recipe(execution: &Execution) -> Recipe {
    let device = match &execution.device {
        DeviceChoice::Auto => "auto",
        DeviceChoice::Cpu => "cpu",
        DeviceChoice::Gpu => "gpu",
        DeviceChoice::Named(name) => name,
    };
    (device.to_owned(), execution.threads)
}

/// Matches a single rectified pair, and returns its maps as a Matched.
///
/// It takes the arguments of Matcher.match and of Matcher; see help(mrfgs.Matcher). For many pairs use a Matcher, which opens the device
/// once.
#[pyfunction]
#[pyo3(
    name = "match",
    signature = (left, right, max_disparity=None, *, min_disparity=None, mask=None, no_data=None, roi=None, prior=None,
                 prior_sigma=None, prior_kind=None, method=None, options=None, memory=None, warn=true, device=None, threads=None)
)]
#[allow(clippy::too_many_arguments, reason = "keywords in Python")]
pub(crate) fn match_(
    py: Python,
    left: &Bound<PyAny>,
    right: &Bound<PyAny>,
    max_disparity: Option<&Bound<PyAny>>,
    min_disparity: Option<&Bound<PyAny>>,
    mask: Option<&Bound<PyAny>>,
    no_data: Option<f64>,
    roi: Option<&Bound<PyAny>>,
    prior: Option<&Bound<PyAny>>,
    prior_sigma: Option<&Bound<PyAny>>,
    prior_kind: Option<&str>,
    method: Option<&Bound<PyAny>>,
    options: Option<&Bound<PyAny>>,
    memory: Option<&Bound<PyAny>>,
    warn: bool,
    device: Option<&Bound<PyAny>>,
    threads: Option<&Bound<PyAny>>,
) -> PyResult<PyMatched> {
    let matcher = PyMatcher::new(py, device, threads)?;
    matcher.run(
        py,
        left,
        right,
        max_disparity,
        min_disparity,
        mask,
        no_data,
        roi,
        prior,
        prior_sigma,
        prior_kind,
        method,
        options,
        memory,
        warn,
    )
}

/// The region (x, y, width, height) of the left view of `pair`.
fn region(given: &Bound<PyAny>, pair: &Pair, range: DisparityRange) -> PyResult<Region> {
    let [x, y, width, height]: [usize; 4] = given.extract().map_err(|error| {
        let reason = "roi: give (x, y, width, height), four integers of at least 0";
        exceptions::instead(given.py(), error, PyTypeError::new_err(reason))
    })?;
    let part = Rect { x: x..x.saturating_add(width), y: y..y.saturating_add(height) };
    Region::new(part, pair.size(), range).map_err(|error| PyValueError::new_err(format!("roi: {error}")))
}

/// Runs the match on another thread while this one checks for Ctrl-C, as Python reports that only to its main thread.
pub(crate) fn interruptible(
    run: impl FnOnce(&AtomicBool) -> mrfgs::Result<Matched> + Send,
) -> PyResult<Matched> {
    let stop = AtomicBool::new(false);
    let (sender, receiver) = mpsc::channel();
    thread::scope(|scope| {
        let stop = &stop;
        // The sender is dropped with the thread, however it ends.
        scope.spawn(move || {
            // The receiver outlives this send, so it cannot fail.
            let _ = sender.send(run(stop));
        });
        let mut signal = Ok(());
        loop {
            match receiver.recv_timeout(PATIENCE) {
                Ok(matched) => return signal.and_then(|()| matched.map_err(exception)),
                Err(RecvTimeoutError::Timeout) if signal.is_ok() => {
                    signal = Python::attach(|py| py.check_signals());
                    stop.store(signal.is_err(), Ordering::Relaxed);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(PyRuntimeError::new_err("the match panicked, which is a bug in mrfgs"));
                }
            }
        }
    })
}
