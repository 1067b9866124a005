//! The matcher.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;

use mrfgs::image::Rect;
use mrfgs::options::DisparityRange;
use mrfgs::region::Region;
use mrfgs::{AutoRange, Matched, Matcher, Pair, SharedMatcher, check};
use pyo3::exceptions::{PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::arrays::{self, Image};
use crate::exceptions::{self, exception};
use crate::matched::PyMatched;
use crate::sequence::{PATIENCE, PyMatchedSequence, Settings, Shared};
use crate::{options, range};

/// Matches pair after pair, and keeps the device, its compiled shaders and its buffers in between.
///
/// device: "auto", which None stands for, takes a GPU where there is one, else the CPU; "cpu" takes the CPU; "gpu" takes a GPU or any
///     Vulkan or Metal driver, and raises RuntimeError where there is none; anything else is the index of a device, such as 0, or a
///     part of its name, as `mrfgs devices` lists them. The maps are the same, bit for bit.
/// threads: the most threads that a match and its checks take on the CPU, 1 to 1024. None takes as many as processors that the process
///     may use, by affinity and cgroups, or fewer where RAYON_NUM_THREADS, OMP_NUM_THREADS, SLURM_CPUS_PER_TASK or SLURM_CPUS_ON_NODE
///     is a smaller number.
///
/// Threads may share a Matcher: their matches take turns. A process that is forked may use those of its parent on the CPU. Devices do not
/// come along: there "auto" takes the CPU, as Matched.note says, and "gpu" raises RuntimeError; start processes by "spawn" or "forkserver".
#[pyclass(name = "Matcher", frozen, module = "mrfgs")]
pub(crate) struct PyMatcher(Shared);

#[pymethods]
impl PyMatcher {
    #[new]
    #[pyo3(signature = (*, device=None, threads=None))]
    fn new(py: Python, device: Option<&Bound<PyAny>>, threads: Option<&Bound<PyAny>>) -> PyResult<Self> {
        let builder = Matcher::builder().execution(options::execution(device, threads)?);
        let matcher = py.detach(|| SharedMatcher::new(builder)).map_err(exception)?;
        // To open a device takes a while.
        py.check_signals()?;
        Ok(Self(Shared { matcher: Arc::new(matcher), taken: Arc::new(AtomicU32::new(0)) }))
    }

    /// Matches a rectified pair, and returns its maps as a Matched.
    ///
    /// left, right: arrays of shape (height, width) or (height, width, channels): grey, grey and alpha, RGB or RGBA, of uint8,
    ///     uint16, float32 or float64, in any layout. Left (x, y) with disparity d is seen at right (x - d, y). 8 bits are taken as
    ///     they are; 16 bits fill their range with the largest value of both; floats run from the least to the largest value of
    ///     both. Where one view has 8 bits and the other one 16, each fills its range. Whole numbers of other types, such as int64,
    ///     are 8 bits where those of both views are 0 to 255, and 16 bits where they are 0 to 65535; others raise ValueError, because
    ///     they may mean anything. Ignored are pixels of alpha 0, values that are not finite, and what a masked array masks.
    /// max_disparity, min_disparity: the range to search in whole pixels, both ends included. Without max_disparity sparse matches
    ///     find the range, and where the scene goes beyond it the pair is matched once more, over half as many labels more; min_disparity is 0 where max_disparity is given alone.
    /// mask: array of shape (height, width): where it is not 0 the left image is ignored, and the maps are invalid.
    /// no_data: a value that stands for no data: pixels with it in every channel are ignored, in both images.
    /// roi: (x, y, width, height) of a part of the left image in pixels, which alone is matched, in the time of that part; the maps have
    ///     its size. Rig.of_part gives its depths and points.
    /// method: the name of a preset, which mrfgs.presets() lists with what each is for, or the path of a TOML file whose keys replace those
    ///     of the preset "default"; None takes that preset.
    /// options: options that replace those of the method, such as {"fill": "none", "memory": 2048}; mrfgs.options() describes all. A
    ///     key may have its group in front, "refinement.fill", and a group may be a dict, {"refinement": {"fill": "none"}}.
    /// memory: the memory that a match may take, such as "2GiB" or "512MiB"; a pair that needs more is matched in tiles. None takes that
    ///     of the method.
    /// warn: whether to look for what is probably wrong (views swapped, turned, not rectified or of two scenes, a range that cuts off
    ///     part of the scene), and to tell it as a MatchWarning. It takes a part of the time of a match.
    ///
    /// Other threads run meanwhile; Ctrl-C ends it. Raises ValueError for what makes no sense, TypeError for other arrays,
    /// RuntimeError where the wanted device fails, and MemoryError where it does not fit.
    #[pyo3(
        name = "match",
        signature = (left, right, max_disparity=None, *, min_disparity=None, mask=None, no_data=None, roi=None, method=None,
                     options=None, memory=None, warn=true)
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
        method: Option<&Bound<PyAny>>,
        options: Option<&Bound<PyAny>>,
        memory: Option<&Bound<PyAny>>,
        warn: bool,
    ) -> PyResult<PyMatched> {
        self.0.check()?;
        let method = options::method(method, options, memory)?;
        let [left, right] = Image::both(left, right)?;
        let pair = arrays::pair(&left, &right, mask, no_data)?;
        let min_disparity = range::pixels("min_disparity", min_disparity)?;
        let given = range::given(range::pixels("max_disparity", max_disparity)?, min_disparity)?;
        let matcher = &self.0.matcher;
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
                    job.method(&method).cancel(stop).run()
                })
            })
        })?;
        if warn {
            exceptions::warn(py, matched.warnings())?;
        }
        PyMatched::of(py, matched)
    }

    /// Matches pair after pair, and returns an iterator that yields the Matched of each, in order. While a device is at one pair the next
    /// one goes up and the maps of the last one come down.
    ///
    /// pairs: an iterable of pairs (left, right) of arrays as `match` takes them, such as a list, a generator, or
    ///     map(rectification.apply, lefts, rights). Up to three pairs are under way at a time, so a result comes when two more pairs
    ///     have been taken. The arrays of a pair may be used again for the next one.
    ///
    /// The other arguments are those of `match`, for all pairs; masked arrays tell what to ignore in each. The pairs are taken, and
    /// exceptions raised, in the thread that asks for results. An exception of `pairs`, or of a pair that makes no sense, comes after the
    /// results of the pairs before it; messages count pairs from 0. Ctrl-C ends the sequence. So does `close()` of the iterator, which
    /// happens by itself when nothing refers to it any more. Until its end, the Matcher raises RuntimeError for other matches.
    #[pyo3(signature = (pairs, max_disparity=None, *, min_disparity=None, no_data=None, method=None, options=None, memory=None, warn=true))]
    #[allow(clippy::too_many_arguments, reason = "keywords in Python")]
    fn match_all(
        &self,
        pairs: &Bound<PyAny>,
        max_disparity: Option<&Bound<PyAny>>,
        min_disparity: Option<&Bound<PyAny>>,
        no_data: Option<f64>,
        method: Option<&Bound<PyAny>>,
        options: Option<&Bound<PyAny>>,
        memory: Option<&Bound<PyAny>>,
        warn: bool,
    ) -> PyResult<PyMatchedSequence> {
        let method = options::method(method, options, memory)?;
        let min_disparity = range::pixels("min_disparity", min_disparity)?;
        let range = range::given(range::pixels("max_disparity", max_disparity)?, min_disparity)?;
        let pairs = pairs.try_iter().map_err(|_| {
            PyTypeError::new_err("pairs: give an iterable of pairs of arrays, such as zip(lefts, rights)")
        })?;
        let settings = Settings { method, range, min_disparity, no_data, warn };
        Ok(PyMatchedSequence::new(self.0.clone(), settings, pairs))
    }
}

/// Matches one rectified pair, and returns its maps as a Matched.
///
/// It takes the arguments of Matcher.match, and those of Matcher; see help(mrfgs.Matcher). To match many pairs, keep a Matcher:
/// it opens the device once.
#[pyfunction]
#[pyo3(
    name = "match",
    signature = (left, right, max_disparity=None, *, min_disparity=None, mask=None, no_data=None, roi=None, method=None,
                 options=None, memory=None, warn=true, device=None, threads=None)
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
        method,
        options,
        memory,
        warn,
    )
}

/// The region (x, y, width, height) of the left view of `pair`.
fn region(given: &Bound<PyAny>, pair: &Pair, range: DisparityRange) -> PyResult<Region> {
    let [x, y, width, height]: [usize; 4] = given.extract().map_err(|error| {
        let reason = "roi: give (x, y, width, height), four whole numbers of pixels from 0 on";
        exceptions::instead(given.py(), error, PyTypeError::new_err(reason))
    })?;
    let part = Rect { x: x..x.saturating_add(width), y: y..y.saturating_add(height) };
    Region::new(part, pair.size(), range).map_err(|error| PyValueError::new_err(format!("roi: {error}")))
}

/// Does `run` on a thread of its own, while this one, to which alone Python tells of Ctrl-C, looks for that.
fn interruptible(run: impl FnOnce(&AtomicBool) -> mrfgs::Result<Matched> + Send) -> PyResult<Matched> {
    let stop = AtomicBool::new(false);
    let (sender, receiver) = mpsc::channel();
    thread::scope(|scope| {
        let stop = &stop;
        // The sender goes with the thread, however that ends.
        scope.spawn(move || {
            // Somebody waits for it until it is here.
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
                    return Err(PyRuntimeError::new_err("the match panicked, which is a defect of mrfgs"));
                }
            }
        }
    })
}
