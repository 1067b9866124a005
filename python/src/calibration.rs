//! What is known of two cameras.

use std::path::{Path, PathBuf};

use mrfgs::Error;
use mrfgs::calibration;
use mrfgs::calibration::cameras::StereoCalibration;
use mrfgs::image::calib::Unit;
use pyo3::exceptions::{PyFileNotFoundError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::exceptions::exception;
use crate::words;

/// What is known of a pair of cameras, read from files.
///
/// files: the path of a file, or those of several that belong together. The content tells the form: OpenCV's YAML, XML or JSON (K1,
///     D1, K2, D2, R, T, or R1, R2, P1, P2 too), ROS's camera_info of both cameras in any order, Kalibr's camera chain (cam0 is the
///     left camera), a file of EuRoC, KITTI, ORB-SLAM3, VINS-Fusion, Basalt, ZED, OAK or COLMAP, or Middlebury's calib.txt.
/// unit: the unit of the baseline, "mm", "cm" or "m", where the files do not say it or say it wrong.
///
/// Rectification and Rig take it; they take paths, too. Raises FileNotFoundError for a file that is not there, and ValueError for
/// one that makes no sense.
#[pyclass(name = "Calibration", frozen, module = "mrfgs")]
#[derive(Clone)]
pub(crate) struct PyCalibration {
    pub(crate) cameras: StereoCalibration,
    /// The files, as messages name them.
    pub(crate) names: String,
}

impl PyCalibration {
    /// What is given for `calibration`: a calibration, a path, or several.
    pub(crate) fn of(given: &Bound<PyAny>) -> PyResult<Self> {
        if let Ok(calibration) = given.cast::<Self>() {
            return Ok(calibration.get().clone());
        }
        match given.try_iter() {
            // What is one path counts as such, even where it has parts.
            Ok(files) if given.extract::<PathBuf>().is_err() => {
                Self::read(files.collect::<PyResult<Vec<_>>>()?.into_iter(), None)
            }
            _ => Self::read(std::iter::once(given.clone()), None),
        }
    }

    fn read<'py>(files: impl Iterator<Item = Bound<'py, PyAny>>, unit: Option<&str>) -> PyResult<Self> {
        let files = files.map(|file| {
            let path: PathBuf = file.extract().map_err(|_| {
                PyTypeError::new_err(
                    "calibration: give the path of a file, or those of two, or a Calibration",
                )
            })?;
            let name = path.display().to_string();
            if name.contains('\n') {
                let reason =
                    "calibration: give the path of a file; Calibration.of_texts takes what is in one";
                return Err(PyValueError::new_err(reason));
            }
            if !path.exists() {
                return Err(PyFileNotFoundError::new_err(format!(
                    "cannot read {name}: there is no such file"
                )));
            }
            Ok(path)
        });
        let files: Vec<PathBuf> = files.collect::<PyResult<_>>()?;
        let names = files.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ");
        Self::with_unit(calibration::read(&files), names, unit)
    }

    fn with_unit(
        cameras: mrfgs::Result<StereoCalibration>,
        names: String,
        unit: Option<&str>,
    ) -> PyResult<Self> {
        let mut cameras = cameras.map_err(|error| match error {
            Error::Calibration(_) => {
                PyValueError::new_err("calibration: give the path of a file, or those of two")
            }
            error => exception(error),
        })?;
        if let Some(text) = unit {
            let unit: Unit = text.parse().map_err(|expected| {
                PyValueError::new_err(format!("unit: give {expected}, not \"{text}\""))
            })?;
            cameras.unit = unit;
            if let Some(benchmark) = &mut cameras.benchmark {
                benchmark.unit = unit;
            }
        }
        Ok(Self { cameras, names })
    }

    /// An error of what the calibration says, with its name.
    pub(crate) fn wrong(&self, error: Error) -> PyErr {
        match words::calibration(&error, &self.names) {
            Some(text) => PyValueError::new_err(text),
            None => exception(error),
        }
    }
}

#[pymethods]
impl PyCalibration {
    #[new]
    #[pyo3(signature = (*files, unit=None))]
    fn new(files: &Bound<PyTuple>, unit: Option<&str>) -> PyResult<Self> {
        Self::read(files.iter(), unit)
    }

    /// The same of the texts of such files: one, or two that belong together. Messages call them "the text", or "text 1" and
    /// "text 2".
    #[staticmethod]
    #[pyo3(signature = (*texts, unit=None))]
    fn of_texts(texts: Vec<String>, unit: Option<&str>) -> PyResult<Self> {
        let names: Vec<String> = match texts.len() {
            1 => vec!["the text".into()],
            count => (1..=count).map(|i| format!("text {i}")).collect(),
        };
        let files: Vec<_> = names.iter().map(Path::new).zip(texts).collect();
        Self::with_unit(calibration::of_texts(&files), names.join(", "), unit)
    }

    /// (width, height) of the images as the cameras took them; None where the files do not say it.
    #[getter]
    fn size(&self) -> Option<(usize, usize)> {
        self.cameras.size
    }

    /// The unit of the baseline: "mm", "cm", "m", or "unknown" where neither the files nor the caller say it.
    #[getter]
    fn unit(&self) -> &'static str {
        self.cameras.unit.name()
    }

    /// The largest disparity of the pair, in pixels, from the line ndisp of a calib.txt; else None. `match` takes both.
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
}
