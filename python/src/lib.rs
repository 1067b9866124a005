//! The Python module `mrfgs._mrfgs`: arrays in, the crate `mrfgs`, arrays out.

mod arrays;
mod calibration;
mod depth;
mod evaluation;
mod rectification;
mod sequence;
mod words;

use std::ffi::CString;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use mrfgs::check::{self, Warning};
use mrfgs::error::RangeError;
use mrfgs::image::Pair;
use mrfgs::options::{DisparityRange, Execution, GROUPS, Key, Method, PRESETS, Takes};
use mrfgs::{Error, Matched, Matcher};
use numpy::{PyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::{
    PyKeyboardInterrupt, PyMemoryError, PyOSError, PyRuntimeError, PyTypeError, PyUserWarning, PyValueError,
};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};

use sequence::{PyMatchedSequence, Settings, Shared};

pyo3::create_exception!(
    mrfgs,
    MatchWarning,
    PyUserWarning,
    "What is probably wrong with a pair, or with the range of disparities that was searched, and what to do about it."
);

/// The exception that says what went wrong, in the words of Python.
fn exception(error: Error) -> PyErr {
    let text = words::error(&error);
    match error {
        Error::Memory(_) => PyMemoryError::new_err(text),
        Error::Device(_) => PyRuntimeError::new_err(text),
        Error::Write { .. } => PyOSError::new_err(text),
        Error::Interrupted => PyKeyboardInterrupt::new_err(()),
        _ => PyValueError::new_err(text),
    }
}

/// Says what is probably wrong, at the line of Python that called.
fn warn(py: Python, warnings: impl IntoIterator<Item = Warning>) -> PyResult<()> {
    for warning in warnings {
        let text = CString::new(words::warning(&warning))?;
        PyErr::warn(py, &py.get_type::<MatchWarning>(), &text, 1)?;
    }
    Ok(())
}

/// The method: a preset, and what replaces some of its keys.
fn method(preset: &str, options: Option<&Bound<PyDict>>) -> PyResult<Method> {
    let mut changes = Vec::new();
    for (key, value) in options.into_iter().flatten() {
        let key: String = key.extract()?;
        match value.cast::<PyDict>() {
            Ok(group) => {
                for (inner, value) in group {
                    changes.push((format!("{key}.{}", inner.extract::<String>()?), as_written(&value)?));
                }
            }
            Err(_) => changes.push((key, as_written(&value)?)),
        }
    }
    let mut method = Method::preset(preset).map_err(exception)?;
    method.set_all(changes.iter().map(|(key, value)| (&**key, &**value))).map_err(exception)?;
    Ok(method)
}

/// The value of an option as the command line writes it.
fn as_written(value: &Bound<PyAny>) -> PyResult<String> {
    match value.extract::<bool>() {
        Ok(flag) => Ok(flag.to_string()),
        Err(_) => Ok(value.str()?.to_string()),
    }
}

fn execution(device: &str, threads: Option<usize>) -> Execution {
    Execution { device: device.into(), threads, ..Execution::default() }
}

/// The maps of a pair, and what made them. All maps have the shape (height, width) of the images.
#[pyclass(name = "Matched", frozen, get_all, module = "mrfgs")]
struct PyMatched {
    /// Disparity in pixels, float32, +inf where there is none.
    disparity: Py<PyArray2<f32>>,
    /// Disparity before post-processing in pixels, float32, +inf where the left image is masked.
    raw: Py<PyArray2<f32>>,
    /// How far the best runner-up is behind, in 1/8 nat, uint8; 0 where there is no measurement.
    confidence: Py<PyArray2<u8>>,
    /// Why each pixel is what it is, uint8: the sum of 1 match outside the right image, 2 occluded, 4 in a small region, 8 low
    /// confidence, 16 filled, 32 masked, 64 a tie of two disparities, 128 outvoted by the pixels around it; 0 is measured and trusted.
    validity: Py<PyArray2<u8>>,
    /// Disparity of the right view in pixels, float32, +inf where there is none: right (x, y) with disparity d is seen at left
    /// (x + d, y). None unless the option "right-map" asks for it.
    right: Option<Py<PyArray2<f32>>>,
    /// Smallest disparity that was searched, in pixels.
    min_disparity: i32,
    /// Largest disparity that was searched, in pixels.
    max_disparity: i32,
    /// Iterations done, of all phases together.
    iterations: u32,
    /// Tiles that the image was matched in.
    tiles: usize,
    /// What ran it.
    ran_on: String,
    /// Why that is not the device that was hoped for, where that is so; else None.
    note: Option<String>,
}

impl PyMatched {
    fn of(py: Python, matched: Matched) -> PyResult<Self> {
        let range = matched.plan.range;
        let right = matched.maps.right_map().map(|map| arrays::map(py, map)).transpose()?;
        Ok(Self {
            right: right.map(Bound::unbind),
            disparity: arrays::map(py, matched.maps.final_map())?.unbind(),
            raw: arrays::map(py, matched.maps.raw_map())?.unbind(),
            confidence: arrays::map(py, matched.maps.confidence)?.unbind(),
            validity: arrays::map(py, matched.maps.validity)?.unbind(),
            min_disparity: range.min,
            max_disparity: range.max,
            iterations: matched.iterations,
            tiles: matched.tiles.count(),
            ran_on: matched.ran_on,
            note: matched.note.as_ref().map(words::error),
        })
    }
}

#[pymethods]
impl PyMatched {
    #[new]
    #[allow(clippy::too_many_arguments, reason = "what it is made of")]
    fn new(
        disparity: Py<PyArray2<f32>>,
        raw: Py<PyArray2<f32>>,
        confidence: Py<PyArray2<u8>>,
        validity: Py<PyArray2<u8>>,
        right: Option<Py<PyArray2<f32>>>,
        min_disparity: i32,
        max_disparity: i32,
        iterations: u32,
        tiles: usize,
        ran_on: String,
        note: Option<String>,
    ) -> Self {
        Self {
            disparity,
            raw,
            confidence,
            validity,
            right,
            min_disparity,
            max_disparity,
            iterations,
            tiles,
            ran_on,
            note,
        }
    }

    /// How `pickle` and `copy` make another one.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyType>, Bound<'py, PyTuple>)> {
        let maps =
            (self.disparity.bind(py), self.raw.bind(py), self.confidence.bind(py), self.validity.bind(py));
        let (d, r, c, v) = maps;
        let Self { min_disparity, max_disparity, iterations, tiles, ran_on, note, .. } = self;
        let right = self.right.as_ref().map(|right| right.bind(py));
        let all =
            (d, r, c, v, right, min_disparity, max_disparity, iterations, tiles, ran_on, note.as_deref());
        Ok((py.get_type::<Self>(), all.into_pyobject(py)?))
    }

    fn __repr__(&self, py: Python) -> String {
        let shape = self.disparity.bind(py).shape();
        let (height, width) = (shape[0], shape[1]);
        let Self { min_disparity, max_disparity, ran_on, .. } = self;
        format!(
            "<mrfgs.Matched: {width} x {height}, disparities {min_disparity} to {max_disparity}, on {ran_on}>"
        )
    }
}

/// Matches pair after pair, and keeps the device, its compiled shaders and its buffers in between.
///
/// device: "auto" takes a GPU where there is one, else the CPU; "cpu" takes the CPU; "gpu" takes a GPU or any Vulkan or Metal
///     driver, and raises RuntimeError where there is none; anything else is the index of a device, such as "0", or a part of its
///     name, as `mrfgs devices` lists them. The maps are the same, bit for bit.
/// threads: those of the CPU path; None takes one a core.
#[pyclass(name = "Matcher", frozen, module = "mrfgs")]
struct PyMatcher(Shared);

#[pymethods]
impl PyMatcher {
    #[new]
    #[pyo3(signature = (*, device="auto", threads=None))]
    fn new(py: Python, device: &str, threads: Option<usize>) -> PyResult<Self> {
        let execution = execution(device, threads);
        let matcher = py.detach(|| Matcher::builder().execution(execution).build()).map_err(exception)?;
        let matcher = Arc::new(Mutex::new(matcher));
        Ok(Self(Shared { matcher, taken: Arc::new(AtomicBool::new(false)) }))
    }

    /// Matches a rectified pair, and returns its maps as a Matched.
    ///
    /// left, right: arrays of shape (height, width) or (height, width, channels): grey, grey and alpha, RGB or RGBA, of uint8,
    ///     uint16, float32 or float64, in any layout. Left (x, y) with disparity d is seen at right (x - d, y). 8 bits are taken as
    ///     they are; 16 bits fill their range with the largest value of both; floats run from the least to the largest value of
    ///     both. Ignored are pixels of alpha 0, values that are not finite, and what a masked array masks.
    /// max_disparity, min_disparity: the range to search in pixels, both ends included. Without max_disparity sparse matches
    ///     find the range; min_disparity is 0 where max_disparity is given alone.
    /// mask: array of shape (height, width): where it is not 0 the left image is ignored, and the maps are invalid.
    /// no_data: a value that stands for no data: pixels with it in every channel are ignored, in both images.
    /// preset: the name of a preset; mrfgs.presets() lists them, and tells what each is for.
    /// options: options that replace the preset's, such as {"fill": "none", "memory": 2048}; mrfgs.options() describes all. A
    ///     key may have its group in front, "refinement.fill", and a group may be a dict, {"refinement": {"fill": "none"}}.
    /// warn: whether to look for what is probably wrong (views swapped, turned or not rectified, a range that cuts off part of
    ///     the scene), and to tell it as a MatchWarning. It takes a part of the time of a match.
    ///
    /// Other threads run meanwhile; Ctrl-C ends it. Raises ValueError for what makes no sense, TypeError for other arrays,
    /// RuntimeError where the wanted device fails, and MemoryError where it does not fit.
    #[pyo3(
        name = "match",
        signature = (left, right, max_disparity=None, *, min_disparity=None, mask=None, no_data=None, preset="default",
                     options=None, warn=true)
    )]
    #[allow(clippy::too_many_arguments, reason = "keywords in Python")]
    fn run(
        &self,
        py: Python,
        left: &Bound<PyAny>,
        right: &Bound<PyAny>,
        max_disparity: Option<i32>,
        min_disparity: Option<i32>,
        mask: Option<&Bound<PyAny>>,
        no_data: Option<f64>,
        preset: &str,
        options: Option<&Bound<PyDict>>,
        warn: bool,
    ) -> PyResult<PyMatched> {
        self.0.check()?;
        let method = method(preset, options)?;
        let (left, right) = (arrays::Image::of("left", left)?, arrays::Image::of("right", right)?);
        let pair = arrays::pair(&left, &right, mask, no_data)?;
        let given = given_range(max_disparity, min_disparity)?;
        let range = searched(py, &pair, given, min_disparity)?;
        if warn {
            self::warn(py, py.detach(|| check::warnings(&pair, given)))?;
        }
        let matched = py.detach(|| {
            interruptible(|stop| {
                let mut matcher = self.0.matcher.lock().unwrap_or_else(PoisonError::into_inner);
                matcher.job(&pair, range).method(&method).cancel(stop).run()
            })
        })?;
        if warn {
            self::warn(py, check::clipped(&matched.maps, range))?;
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
    #[pyo3(signature = (pairs, max_disparity=None, *, min_disparity=None, no_data=None, preset="default", options=None, warn=true))]
    #[allow(clippy::too_many_arguments, reason = "keywords in Python")]
    fn match_all(
        &self,
        pairs: &Bound<PyAny>,
        max_disparity: Option<i32>,
        min_disparity: Option<i32>,
        no_data: Option<f64>,
        preset: &str,
        options: Option<&Bound<PyDict>>,
        warn: bool,
    ) -> PyResult<PyMatchedSequence> {
        let method = method(preset, options)?;
        let range = given_range(max_disparity, min_disparity)?;
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
    signature = (left, right, max_disparity=None, *, min_disparity=None, mask=None, no_data=None, preset="default",
                 options=None, warn=true, device="auto", threads=None)
)]
#[allow(clippy::too_many_arguments, reason = "keywords in Python")]
fn match_(
    py: Python,
    left: &Bound<PyAny>,
    right: &Bound<PyAny>,
    max_disparity: Option<i32>,
    min_disparity: Option<i32>,
    mask: Option<&Bound<PyAny>>,
    no_data: Option<f64>,
    preset: &str,
    options: Option<&Bound<PyDict>>,
    warn: bool,
    device: &str,
    threads: Option<usize>,
) -> PyResult<PyMatched> {
    let matcher = PyMatcher::new(py, device, threads)?;
    matcher.run(py, left, right, max_disparity, min_disparity, mask, no_data, preset, options, warn)
}

/// Describes the options: a dict from each group to a dict from each of its keys to a dict with
///
/// meaning: what it does,
/// takes: the unit and the range of its values,
/// words: the words that it takes, with what each means; empty where it takes no words,
/// source: the section of the paper that it comes from, or other work; "open" where the paper leaves the choice open,
/// and, by the name of each preset, its value in that preset.
#[pyfunction]
fn options(py: Python) -> PyResult<Bound<PyDict>> {
    let groups = PyDict::new(py);
    for group in GROUPS {
        let keys = PyDict::new(py);
        for key in group.keys {
            keys.set_item(key.name(), option(py, group.name, key)?)?;
        }
        groups.set_item(group.name, keys)?;
    }
    Ok(groups)
}

/// Lists the presets: a dict from the name of each to what it is for.
#[pyfunction]
fn presets(py: Python) -> PyResult<Bound<PyDict>> {
    let presets = PyDict::new(py);
    for preset in PRESETS {
        presets.set_item(preset.name, preset.about)?;
    }
    Ok(presets)
}

/// Describes an option.
fn option<'py>(py: Python<'py>, group: &str, key: &Key) -> PyResult<Bound<'py, PyDict>> {
    let (option, words) = (PyDict::new(py), PyDict::new(py));
    if let Takes::Words(all) = key.takes {
        for word in all {
            words.set_item(word.word, word.meaning)?;
        }
    }
    option.set_item("meaning", key.meaning)?;
    option.set_item("takes", key.to_string())?;
    option.set_item("words", words)?;
    option.set_item("source", key.source)?;
    for preset in PRESETS {
        match &preset.method().table()[group][key.name()] {
            toml::Value::Boolean(value) => option.set_item(preset.name, value)?,
            toml::Value::Integer(value) => option.set_item(preset.name, value)?,
            toml::Value::Float(value) => option.set_item(preset.name, value)?,
            value => option.set_item(preset.name, value.as_str())?,
        }
    }
    Ok(option)
}

/// How long a Ctrl-C may wait until somebody looks.
const PATIENCE: Duration = Duration::from_millis(50);

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

/// The range that is given.
fn given_range(max: Option<i32>, min: Option<i32>) -> PyResult<Option<DisparityRange>> {
    max.map(|max| DisparityRange::new(min.unwrap_or(0), max)).transpose().map_err(exception)
}

/// The range to search: the one that is given, or that of sparse matches.
fn searched(
    py: Python,
    pair: &Pair,
    given: Option<DisparityRange>,
    min: Option<i32>,
) -> PyResult<DisparityRange> {
    given.map_or_else(|| py.detach(|| found_range(pair, min)), Ok)
}

/// The range that sparse matches find, from `min` on where that is given.
fn found_range(pair: &Pair, min: Option<i32>) -> PyResult<DisparityRange> {
    let Some(found) = check::range(pair).map_err(exception)? else {
        return Err(exception(RangeError::NotFound.into()));
    };
    DisparityRange::new(min.unwrap_or(found.min), found.max).map_err(exception)
}

#[pymodule]
fn _mrfgs(module: &Bound<PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("MatchWarning", module.py().get_type::<MatchWarning>())?;
    module.add_function(wrap_pyfunction!(match_, module)?)?;
    module.add_function(wrap_pyfunction!(options, module)?)?;
    module.add_function(wrap_pyfunction!(presets, module)?)?;
    module.add_function(wrap_pyfunction!(evaluation::evaluate, module)?)?;
    module.add_class::<calibration::PyCalibration>()?;
    module.add_class::<PyMatched>()?;
    module.add_class::<PyMatchedSequence>()?;
    module.add_class::<PyMatcher>()?;
    module.add_class::<depth::PyPoints>()?;
    module.add_class::<rectification::PyRectification>()?;
    module.add_class::<depth::PyRig>()
}
