//! A third camera.

use std::path::{Path, PathBuf};

use mrfgs::calibration::cameras::ThirdCamera;
use mrfgs::calibration::{self, third};
use pyo3::exceptions::{PyFileNotFoundError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};

use crate::exceptions::{self, exception};

/// A camera besides the pair, such as a colour camera; `Rig.registered` gives depths in its view.
///
/// file: the path of a file with its lens, image size and pose relative to the left camera: one camera with the names of OpenCV or ROS (K,
///     D, R, T and image_size, where X in the frame of the left camera is R X + T in its own), the last camera of a Kalibr chain, or the
///     camera of an OAK calibration that is not part of its pair.
///
/// Raises FileNotFoundError if the file does not exist, and ValueError if it is not valid.
#[pyclass(name = "ThirdCamera", frozen, module = "mrfgs")]
pub(crate) struct PyThirdCamera {
    pub(crate) camera: ThirdCamera,
    /// The name and the text of the file, for copies.
    made_of: (String, String),
}

impl PyThirdCamera {
    /// Converts the argument `camera`: a ThirdCamera, or the path of its file.
    pub(crate) fn of(given: &Bound<PyAny>) -> PyResult<ThirdCamera> {
        if let Ok(camera) = given.cast::<Self>() {
            return Ok(camera.get().camera);
        }
        let path: PathBuf = given.extract().map_err(|error| {
            let reason = "camera: give a ThirdCamera, or the path of its file";
            exceptions::instead(given.py(), error, PyTypeError::new_err(reason))
        })?;
        Ok(Self::read(&path)?.camera)
    }

    fn read(path: &Path) -> PyResult<Self> {
        let name = path.display().to_string();
        if name.contains('\n') {
            let reason = "file: give the path of a file, or pass its content to ThirdCamera.of_text";
            return Err(PyValueError::new_err(reason));
        }
        if !path.exists() {
            return Err(PyFileNotFoundError::new_err(format!("cannot read {name}: there is no such file")));
        }
        Self::of_named(name, calibration::text(path).map_err(exception)?)
    }

    fn of_named(name: String, text: String) -> PyResult<Self> {
        let camera = third::of_text(Path::new(&name), &text).map_err(exception)?;
        Ok(Self { camera, made_of: (name, text) })
    }
}

#[pymethods]
impl PyThirdCamera {
    #[new]
    fn new(file: PathBuf) -> PyResult<Self> {
        Self::read(&file)
    }

    /// Reads it from the text of such a file.
    #[staticmethod]
    fn of_text(text: String) -> PyResult<Self> {
        Self::of_named("the text".into(), text)
    }

    /// (width, height) of its images, in pixels.
    #[getter]
    fn size(&self) -> (usize, usize) {
        self.camera.size
    }

    /// The unit of its distance to the left camera: "mm", "cm", "m", or "unknown", which means that of the pair.
    #[getter]
    fn unit(&self) -> &'static str {
        self.camera.unit.name()
    }

    fn __repr__(&self) -> String {
        let (width, height) = self.size();
        format!("<mrfgs.ThirdCamera: {}, {width} x {height}>", self.made_of.0)
    }

    /// Pickles the text, as the file may no longer exist.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        Ok((py.get_type::<Self>().getattr("_again")?, self.made_of.clone().into_pyobject(py)?))
    }

    #[classmethod]
    fn _again(_: &Bound<PyType>, name: String, text: String) -> PyResult<Self> {
        Self::of_named(name, text)
    }
}
