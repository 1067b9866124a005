//! Calibrations of two cameras.

use std::path::{Path, PathBuf};

use mrfgs::Error;
use mrfgs::calibration;
use mrfgs::calibration::cameras::StereoCalibration;
use mrfgs::image::Rect;
use mrfgs::image::calib::Unit;
use pyo3::exceptions::{PyFileNotFoundError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};

use crate::exceptions::{self, exception};
use crate::words;

/// The calibration of a pair of cameras, read from files.
///
/// files: the path of a file, or paths of several that belong together, recognised by content: OpenCV's YAML, XML or JSON (K1, D1, K2, D2,
///     R, T, or R1, R2, P1, P2 too), ROS's camera_info of both cameras in any order, Kalibr's camera chain (cam0 is the left camera), a
///     file of EuRoC, KITTI, ORB-SLAM3, VINS-Fusion, Basalt, ZED, OAK or COLMAP, or Middlebury's calib.txt.
/// unit: the unit of the baseline, "mm", "cm" or "m", if the files lack it or have a wrong one.
/// crop: (x, y, width, height) of the part of the calibrated images that your images show, possibly scaled, in pixels; None if they show
///     all, or for OAK cameras the centre.
///
/// Accepted by Rectification and Rig, as are paths. Raises FileNotFoundError if a file does not exist, and ValueError if it is not a valid
/// calibration.
#[pyclass(name = "Calibration", frozen, module = "mrfgs", from_py_object)]
#[derive(Clone)]
pub(crate) struct PyCalibration {
    pub(crate) cameras: StereoCalibration,
    /// The files, as messages name them.
    pub(crate) names: String,
    /// The arguments, for copies: name and text of each file, unit and crop.
    made_of: (Vec<(String, String)>, Option<String>, Option<Crop>),
}

/// First column, first row, width and height.
type Crop = (usize, usize, usize, usize);

impl PyCalibration {
    /// Converts the argument `calibration`: a Calibration, a path, or several paths.
    pub(crate) fn of(given: &Bound<PyAny>) -> PyResult<Self> {
        if let Ok(calibration) = given.cast::<Self>() {
            return Ok(calibration.get().clone());
        }
        match given.try_iter() {
            // A single path may itself be iterable.
            Ok(files) if given.extract::<PathBuf>().is_err() => {
                Self::read(files.collect::<PyResult<Vec<_>>>()?.into_iter(), None, None)
            }
            _ => Self::read(std::iter::once(given.clone()), None, None),
        }
    }

    fn read<'py>(
        files: impl Iterator<Item = Bound<'py, PyAny>>,
        unit: Option<&str>,
        crop: Option<Crop>,
    ) -> PyResult<Self> {
        let files = files.map(|file| {
            let path: PathBuf = file.extract().map_err(|error| {
                let reason = "calibration: give the path of a file, or two paths, or a Calibration";
                exceptions::instead(file.py(), error, PyTypeError::new_err(reason))
            })?;
            let name = path.display().to_string();
            if name.contains('\n') {
                let reason =
                    "calibration: give the path of a file, or pass its content to Calibration.of_texts";
                return Err(PyValueError::new_err(reason));
            }
            if !path.exists() {
                return Err(PyFileNotFoundError::new_err(format!(
                    "cannot read {name}: there is no such file"
                )));
            }
            Ok(path)
        });
        let texts = files.map(|file| {
            let path = file?;
            let text = calibration::text(&path).map_err(exception)?;
            Ok((path.display().to_string(), text))
        });
        Self::of_named(texts.collect::<PyResult<_>>()?, unit, crop)
    }

    /// The calibration in the texts of files, each with a name for messages.
    fn of_named(files: Vec<(String, String)>, unit: Option<&str>, crop: Option<Crop>) -> PyResult<Self> {
        let texts: Vec<_> = files.iter().map(|(name, text)| (Path::new(name), text.clone())).collect();
        let mut cameras = calibration::of_texts(&texts).map_err(|error| match error {
            Error::Calibration(_) => {
                PyValueError::new_err("calibration: give the path of a file, or two paths")
            }
            error => exception(error),
        })?;
        if let Some(text) = unit {
            cameras.set_unit(self::unit(text)?);
        }
        let names = files.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
        if let Some((x, y, width, height)) = crop {
            let part = Rect { x: x..x.saturating_add(width), y: y..y.saturating_add(height) };
            let error = |error| PyValueError::new_err(format!("crop: {names}: {error}"));
            cameras = cameras.of_part(&part).map_err(error)?;
        }
        Ok(Self { cameras, names, made_of: (files, unit.map(str::to_owned), crop) })
    }

    /// An error about the calibration, with its name.
    pub(crate) fn wrong(&self, error: Error) -> PyErr {
        match words::calibration(&error, &self.names) {
            Some(text) => PyValueError::new_err(text),
            None => exception(error),
        }
    }
}

/// The unit of a baseline.
pub(crate) fn unit(text: &str) -> PyResult<Unit> {
    text.parse().map_err(|expected| PyValueError::new_err(format!("unit: give {expected}, not \"{text}\"")))
}

#[pymethods]
impl PyCalibration {
    #[new]
    #[pyo3(signature = (*files, unit=None, crop=None))]
    fn new(files: &Bound<PyTuple>, unit: Option<&str>, crop: Option<Crop>) -> PyResult<Self> {
        Self::read(files.iter(), unit, crop)
    }

    /// Reads a calibration from the texts of such files: one, or two that belong together. Messages call them "the text", or "text 1" and
    /// "text 2".
    #[staticmethod]
    #[pyo3(signature = (*texts, unit=None, crop=None))]
    fn of_texts(texts: Vec<String>, unit: Option<&str>, crop: Option<Crop>) -> PyResult<Self> {
        let name = |i: usize| if texts.len() == 1 { "the text".into() } else { format!("text {}", i + 1) };
        Self::of_named((0..).map(name).zip(texts.clone()).collect(), unit, crop)
    }

    /// (width, height) of the raw images; None if the files lack it.
    #[getter]
    fn size(&self) -> Option<(usize, usize)> {
        self.cameras.size
    }

    /// The unit of the baseline: "mm", "cm", "m", or "unknown" if neither files nor caller give it.
    #[getter]
    fn unit(&self) -> &'static str {
        self.cameras.unit.name()
    }

    /// The largest disparity of the pair, in pixels, from ndisp in a calib.txt, else None. Pass it to `match`.
    #[getter]
    fn max_disparity(&self) -> Option<i64> {
        self.cameras
            .benchmark
            .as_ref()
            .and_then(|benchmark| benchmark.ndisp)
            .map(|ndisp| i64::from(ndisp) - 1)
    }

    fn __repr__(&self) -> String {
        format!("<mrfgs.Calibration: {}, unit {}>", self.names, self.unit())
    }

    /// Pickles the texts, as the files may no longer exist.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (files, unit, crop) = &self.made_of;
        let again = py.get_type::<Self>().getattr("_again")?;
        Ok((again, (files.clone(), unit.as_deref(), *crop).into_pyobject(py)?))
    }

    #[classmethod]
    fn _again(
        _: &Bound<PyType>,
        files: Vec<(String, String)>,
        unit: Option<&str>,
        crop: Option<Crop>,
    ) -> PyResult<Self> {
        Self::of_named(files, unit, crop)
    }
}
