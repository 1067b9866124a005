//! The Python module `mrfgs._mrfgs`: arrays in, the matcher of the crate `mrfgs`, arrays out.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use mrfgs::front::check;
use mrfgs::image::raster::{self, Raster, Samples};
use mrfgs::image::{Pair, Plane};
use mrfgs::options::{Choice, DisparityRange, Execution, Method};
use mrfgs::solver::Observer;
use mrfgs::{Error, Matched, Matcher};
use numpy::{
    IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyKeyboardInterrupt, PyMemoryError, PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The exception that says what went wrong.
fn exception(error: Error) -> PyErr {
    match error {
        Error::Memory(_) => PyMemoryError::new_err(error.to_string()),
        Error::Device(_) => PyRuntimeError::new_err(error.to_string()),
        Error::Interrupted => PyKeyboardInterrupt::new_err(()),
        _ => PyValueError::new_err(error.to_string()),
    }
}

/// The samples of an array, borrowed; copied where they do not lie in one piece.
fn samples<'a, T: numpy::Element + Copy>(array: &'a PyReadonlyArrayDyn<T>) -> Cow<'a, [T]> {
    match array.as_slice() {
        Ok(slice) => Cow::Borrowed(slice),
        Err(_) => array.as_array().iter().copied().collect::<Vec<_>>().into(),
    }
}

/// An image in an array, kept alive and unchanged while it is read.
enum Pixels<'py> {
    Byte(PyReadonlyArrayDyn<'py, u8>),
    Word(PyReadonlyArrayDyn<'py, u16>),
    Float(PyReadonlyArrayDyn<'py, f32>),
    Double(PyReadonlyArrayDyn<'py, f64>),
}

impl<'py> Pixels<'py> {
    fn of(name: &str, array: &Bound<'py, PyUntypedArray>) -> PyResult<Self> {
        let array = array.as_any();
        if let Ok(array) = array.extract() {
            return Ok(Self::Byte(array));
        }
        if let Ok(array) = array.extract() {
            return Ok(Self::Word(array));
        }
        if let Ok(array) = array.extract() {
            return Ok(Self::Float(array));
        }
        if let Ok(array) = array.extract() {
            return Ok(Self::Double(array));
        }
        Err(PyTypeError::new_err(format!("{name}: give an array of uint8, uint16, float32 or float64")))
    }

    fn raster(&self, name: &str) -> PyResult<Raster<'_>> {
        let (shape, samples) = match self {
            Self::Byte(a) => (a.shape(), Samples::Byte(samples(a))),
            Self::Word(a) => (a.shape(), Samples::Word(samples(a))),
            Self::Float(a) => (a.shape(), Samples::Float(samples(a))),
            Self::Double(a) => (a.shape(), Samples::Double(samples(a))),
        };
        let (height, width, channels) = match *shape {
            [height, width] => (height, width, 1),
            [height, width, channels] => (height, width, channels),
            _ => {
                let reason =
                    format!("{name}: give an array of shape (height, width) or (height, width, channels)");
                return Err(PyValueError::new_err(reason));
            }
        };
        Raster::new(width, height, channels, samples)
            .map_err(|error| PyValueError::new_err(format!("{name}: {error}")))
    }
}

/// The pair of two arrays, whose colours are red, green, blue.
fn pair(
    left: &Bound<PyUntypedArray>,
    right: &Bound<PyUntypedArray>,
    mask: Option<PyReadonlyArrayDyn<bool>>,
) -> PyResult<Pair> {
    let (left, right) = (Pixels::of("left", left)?, Pixels::of("right", right)?);
    let mask = match mask {
        Some(mask) => match *mask.shape() {
            [height, width] => Some(Plane::new(width, height, samples(&mask).into_owned())),
            _ => return Err(PyValueError::new_err("mask: give an array of shape (height, width)")),
        },
        None => None,
    };
    raster::pair(left.raster("left")?, right.raster("right")?, mask.as_ref()).map_err(exception)
}

/// The method: a preset, and what replaces some of its keys.
fn method(preset: &str, options: Option<&Bound<PyDict>>) -> PyResult<Method> {
    let mut method = Method::preset(preset).map_err(exception)?;
    for (key, value) in options.into_iter().flatten() {
        // As the command line writes them.
        let value = match value.extract::<bool>() {
            Ok(flag) => flag.to_string(),
            Err(_) => value.str()?.to_string(),
        };
        method.set(&key.extract::<String>()?, &value).map_err(exception)?;
    }
    method.validated().map_err(exception)
}

fn execution(backend: &str, device: Option<String>, threads: Option<usize>) -> PyResult<Execution> {
    let backend = match backend {
        "auto" => Choice::Auto,
        "cpu" => Choice::Cpu,
        "gpu" => Choice::Gpu,
        _ => return Err(PyValueError::new_err(format!("backend: {backend} is none of auto, cpu and gpu"))),
    };
    Ok(Execution { backend, device, threads, ..Execution::default() })
}

/// What a match leaves behind.
#[pyclass(name = "Matched", frozen, get_all, module = "mrfgs")]
struct PyMatched {
    disparity: Py<PyArray2<f32>>,
    raw: Py<PyArray2<f32>>,
    confidence: Py<PyArray2<u8>>,
    validity: Py<PyArray2<u8>>,
    min_disparity: i32,
    max_disparity: i32,
    iterations: u32,
    tiles: usize,
    ran_on: String,
    note: Option<String>,
}

impl PyMatched {
    fn new(py: Python, matched: Matched) -> PyResult<Self> {
        fn array<T: numpy::Element>(py: Python, plane: Plane<T>) -> PyResult<Py<PyArray2<T>>> {
            let shape = [plane.height(), plane.width()];
            Ok(plane.into_data().into_pyarray(py).reshape(shape)?.unbind())
        }
        let range = matched.plan.range;
        Ok(Self {
            disparity: array(py, matched.maps.final_map())?,
            raw: array(py, matched.maps.raw_map())?,
            confidence: array(py, matched.maps.confidence)?,
            validity: array(py, matched.maps.validity)?,
            min_disparity: range.min,
            max_disparity: range.max,
            iterations: matched.iterations,
            tiles: matched.tiles.count(),
            ran_on: matched.ran_on,
            note: matched.note,
        })
    }
}

/// Matches pair after pair, and keeps in between what is dear.
#[pyclass(name = "Matcher", frozen, module = "mrfgs")]
struct PyMatcher(Mutex<Matcher>);

#[pymethods]
impl PyMatcher {
    #[new]
    #[pyo3(signature = (*, backend="auto", device=None, threads=None))]
    fn new(py: Python, backend: &str, device: Option<String>, threads: Option<usize>) -> PyResult<Self> {
        let execution = execution(backend, device, threads)?;
        let matcher = py.detach(|| Matcher::new(&execution)).map_err(exception)?;
        Ok(Self(Mutex::new(matcher)))
    }

    #[pyo3(
        name = "match",
        signature = (left, right, max_disparity=None, *, min_disparity=None, mask=None, preset="default", options=None)
    )]
    #[allow(clippy::too_many_arguments, reason = "keywords in Python")]
    fn run(
        &self,
        py: Python,
        left: &Bound<PyUntypedArray>,
        right: &Bound<PyUntypedArray>,
        max_disparity: Option<i32>,
        min_disparity: Option<i32>,
        mask: Option<PyReadonlyArrayDyn<bool>>,
        preset: &str,
        options: Option<&Bound<PyDict>>,
    ) -> PyResult<PyMatched> {
        let method = method(preset, options)?;
        let pair = pair(left, right, mask)?;
        let matched = py.detach(|| {
            let range = range(&pair, min_disparity, max_disparity)?;
            interruptible(|observer| {
                let mut matcher = self.0.lock().unwrap_or_else(PoisonError::into_inner);
                matcher.run(&pair, range, &method, observer)
            })
        })?;
        PyMatched::new(py, matched)
    }
}

/// How long a Ctrl-C may wait until somebody looks.
const PATIENCE: Duration = Duration::from_millis(50);

/// Does `run` on a thread of its own, while this one, to which alone Python tells of Ctrl-C, looks for that.
fn interruptible(run: impl FnOnce(Observer) -> mrfgs::Result<Matched> + Send) -> PyResult<Matched> {
    let stop = AtomicBool::new(false);
    let (sender, receiver) = mpsc::channel();
    thread::scope(|scope| {
        let stop = &stop;
        // The sender goes with the thread, however that ends.
        scope.spawn(move || {
            let mut observer = |_| {
                if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            // Somebody waits for it until it is here.
            let _ = sender.send(run(&mut observer));
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

/// The range to search: as told, else by sparse matches.
fn range(pair: &Pair, min: Option<i32>, max: Option<i32>) -> PyResult<DisparityRange> {
    let range = match max {
        Some(max) => DisparityRange::new(min.unwrap_or(0), max),
        None => match check::range(pair) {
            Some(found) => DisparityRange::new(min.unwrap_or(found.min), found.max),
            None => {
                let reason = "max_disparity: give the largest disparity to search, in pixels: there are too few \
                              matches to find it";
                return Err(PyValueError::new_err(reason));
            }
        },
    };
    range.map_err(exception)
}

#[pymodule]
fn _mrfgs(module: &Bound<PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<PyMatched>()?;
    module.add_class::<PyMatcher>()
}
