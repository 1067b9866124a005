//! A camera beside the pair.

use std::path::{Path, PathBuf};

use mrfgs::calibration::cameras::ThirdCamera;
use mrfgs::calibration::{self, third};
use pyo3::exceptions::{PyFileNotFoundError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};

use crate::exceptions::{self, exception};

/// A camera beside the pair, such as the colour camera of a rig: `Rig.registered` gives depths in its view.
///
/// file: the path of a file that says its lens, its size and how it stands to the left camera: one camera by the names of OpenCV or ROS (K,
///     D, R, T and image_size, where a point X in the frame of the left camera is R X + T in its own), the last camera of Kalibr's chain,
///     or the camera of an OAK's calibration that is not one of its pair.
///
/// Raises FileNotFoundError for a file that is not there, and ValueError for one that makes no sense.
#[pyclass(name = "ThirdCamera", frozen, module = "mrfgs")]
pub(crate) struct PyThirdCamera {
    pub(crate) camera: ThirdCamera,
    /// What it was made of, for copies: the file, as messages name it, and its text.
    made_of: (String, String),
}

impl PyThirdCamera {
    /// What is given for `camera`: one, or the path of its file.
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
            let reason = "file: give the path of a file; ThirdCamera.of_text takes what is in one";
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

    /// The same of the text of such a file.
    #[staticmethod]
    fn of_text(text: String) -> PyResult<Self> {
        Self::of_named("the text".into(), text)
    }

    /// (width, height) of its images, in pixels.
    #[getter]
    fn size(&self) -> (usize, usize) {
        self.camera.size
    }

    /// The unit of its distance from the left camera: "mm", "cm", "m", or "unknown", which is taken for that of the pair.
    #[getter]
    fn unit(&self) -> &'static str {
        self.camera.unit.name()
    }

    fn __repr__(&self) -> String {
        let (width, height) = self.size();
        format!("<mrfgs.ThirdCamera: {}, {width} x {height}>", self.made_of.0)
    }

    /// How `pickle` and `copy` make another one: of the text, as the file may be gone by then.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        Ok((py.get_type::<Self>().getattr("_again")?, self.made_of.clone().into_pyobject(py)?))
    }

    #[classmethod]
    fn _again(_: &Bound<PyType>, name: String, text: String) -> PyResult<Self> {
        Self::of_named(name, text)
    }
}
