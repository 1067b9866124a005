//! Depths and points.

use std::path::PathBuf;

use mrfgs::calibration::matrix::Matrix;
use mrfgs::depth::Rig;
use mrfgs::image::calib::{Calibration, Camera, Unit};
use mrfgs::image::cloud::{Cloud, Point};
use mrfgs::image::{Pair, Plane, write};
use mrfgs::options::MAX_DISPARITY;
use mrfgs::rectification::Doubt;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};

use crate::arrays::{self, Image};
use crate::calibration::{self, PyCalibration};
use crate::exceptions::{self, exception};
use crate::matched::PyMatched;
use crate::third::PyThirdCamera;
use crate::words;

/// The cameras of a rectified pair, which turn disparities into depths and points.
///
/// calibration: the calibration of the rectified pair, as a Calibration, the path of a file, or a list of two paths: calib.txt, OpenCV's P1
///     and P2, ROS's projections. For raw images, use Rectification.rig.
/// size: (width, height) of the rectified images in pixels, if the calibration has several; None uses its only one.
///
/// A point at depth Z has disparity d with d + doffs = baseline * f / Z. Depths and points have the unit of the baseline. Raises ValueError
/// for a calibration without rectified cameras. Rig.of takes numbers instead of a calibration.
#[pyclass(name = "Rig", frozen, module = "mrfgs")]
pub(crate) struct PyRig {
    rig: Rig,
    camera: Camera,
    doffs: f64,
    baseline: f64,
    size: Option<(usize, usize)>,
    /// The origin of the values, for messages.
    names: String,
    /// The rotation from the original left camera's frame to the rectified frame, if there was a rectification.
    rectifying: Option<Matrix>,
}

/// The state of a rig: focal lengths, principal point, doffs and baseline, unit, size, origin, and rotation of the rectification.
type Numbers = ([f64; 2], [f64; 2], [f64; 2], String, Option<(usize, usize)>, String, Option<Matrix>);

impl PyRig {
    /// The rig of a rectified pair, from the calibration `known` and the rotation that rectified the left image, if there was one.
    pub(crate) fn of_rectified(
        rectified: &Calibration,
        rectifying: Option<Matrix>,
        known: &PyCalibration,
    ) -> PyResult<Self> {
        Self::named(rectified, rectifying, known.names.clone()).map_err(|error| known.wrong(error))
    }

    fn named(rectified: &Calibration, rectifying: Option<Matrix>, names: String) -> mrfgs::Result<Self> {
        let mut rig = Rig::new(rectified)?;
        if let Some(rectifying) = &rectifying {
            rig = rig.rectified_by(rectifying);
        }
        let size =
            rectified.width.zip(rectified.height).map(|(width, height)| (width as usize, height as usize));
        // A rig exists only if its calibration has these values.
        let camera = rectified.camera.unwrap_or(Camera { focal_length: [0.0; 2], principal_point: [0.0; 2] });
        let (doffs, baseline) = (rectified.doffs.unwrap_or_default(), rectified.baseline.unwrap_or_default());
        Ok(Self { rig, camera, doffs, baseline, size, names, rectifying })
    }

    fn of_numbers(numbers: Numbers) -> PyResult<Self> {
        let (focal_length, principal_point, [doffs, baseline], unit, size, names, rectifying) = numbers;
        let unit = calibration::unit(&unit)?;
        let mut rectified = Calibration::of_cameras(Camera { focal_length, principal_point }, baseline, unit);
        rectified.doffs = Some(doffs);
        [rectified.width, rectified.height] = match size {
            Some((width, height)) => [width, height].map(|count| u32::try_from(count).ok()),
            None => [None; 2],
        };
        Self::named(&rectified, rectifying, names).map_err(exception)
    }

    fn numbers(&self) -> Numbers {
        let Camera { focal_length, principal_point } = self.camera;
        let (unit, names) = (self.rig.unit().name().into(), self.names.clone());
        (focal_length, principal_point, [self.doffs, self.baseline], unit, self.size, names, self.rectifying)
    }

    /// Refuses a map whose size differs from the calibration.
    fn check(&self, name: &str, (w, h): (usize, usize)) -> PyResult<()> {
        match self.size {
            Some((width, height)) if (width, height) != (w, h) => Err(PyValueError::new_err(format!(
                "{name}: is {w} x {h}, but {} is for images of {width} x {height}: give the calibration of this size",
                self.names
            ))),
            _ => Ok(()),
        }
    }

    /// The error of millimetres without a known unit.
    fn unit_unknown(&self) -> PyErr {
        PyValueError::new_err(format!(
            "{}: lacks the unit of the baseline; use Calibration(..., unit=\"m\") or Rig.of(..., unit=\"m\"), or add an \
             entry `unit` to the file: mm, cm or m",
            self.names
        ))
    }

    fn disparities(&self, disparity: &Bound<PyAny>) -> PyResult<Plane<f32>> {
        if disparity.cast::<PyMatched>().is_ok() {
            return Err(PyTypeError::new_err("disparity: give an array, such as Matched.disparity"));
        }
        let map = arrays::disparities("disparity", disparity)?;
        self.check("disparity", map.size())?;
        Ok(map)
    }
}

/// The positions of points, x, y, z one after the other.
fn positions(name: &str, given: &Bound<PyAny>) -> PyResult<Vec<f64>> {
    const EXPECTED: &str = "shape (N, 3), float32 or float64";
    match arrays::table::<f64>(name, given, Some(3), EXPECTED) {
        Err(error) if error.is_instance_of::<PyTypeError>(given.py()) => {
            let singles = arrays::table::<f32>(name, given, Some(3), EXPECTED)?;
            Ok(singles.into_iter().map(f64::from).collect())
        }
        doubles => doubles,
    }
}

/// Warns about the calibration of a rectified pair.
fn tell(py: Python, rectified: &Calibration, size: Option<(usize, usize)>, names: &str) -> PyResult<()> {
    let doubts = Doubt::about(rectified, size.map(|(width, _)| width));
    exceptions::tell(py, doubts.iter().map(|doubt| words::doubt(doubt, names)))
}

#[pymethods]
impl PyRig {
    #[new]
    #[pyo3(signature = (calibration, *, size=None))]
    fn new(py: Python, calibration: &Bound<PyAny>, size: Option<(usize, usize)>) -> PyResult<Self> {
        let known = PyCalibration::of(calibration)?;
        let rectified = known.cameras.of_rectified_images(size).map_err(|error| known.wrong(error))?;
        let rectified = rectified.ok_or_else(|| {
            PyValueError::new_err(format!(
                "{}: describes images that are not rectified; use Rectification(...).rig, or give the calibration of the \
                 rectified pair",
                known.names
            ))
        })?;
        let made = Self::of_rectified(&rectified, None, &known)?;
        tell(py, &rectified, made.size, &known.names)?;
        Ok(made)
    }

    /// Makes the rig of a rectified pair from its focal length and the distance between its cameras, without a file.
    ///
    /// focal: the focal length in pixels: the one in millimetres divided by the width of a pixel on the sensor.
    /// baseline: the distance between the cameras, in the unit of all depths.
    /// principal_point: (cx, cy) of the left camera in pixels; None uses the centre of images of `size`, ((width - 1) / 2, (height - 1) /
    ///     2). It affects points but not depths.
    /// doffs: cx of the right camera minus cx of the left one, in pixels.
    /// size: (width, height) of the images in pixels, which maps must have; required without principal_point.
    /// unit: the unit of the baseline, "mm", "cm" or "m"; `millimetres` needs it.
    #[staticmethod]
    #[pyo3(signature = (focal, baseline, *, principal_point=None, doffs=0.0, size=None, unit="unknown"))]
    #[allow(clippy::too_many_arguments, reason = "keywords in Python")]
    fn of(
        py: Python,
        focal: f64,
        baseline: f64,
        principal_point: Option<[f64; 2]>,
        doffs: f64,
        size: Option<&Bound<PyAny>>,
        unit: &str,
    ) -> PyResult<Self> {
        for (name, value) in [("focal", focal), ("baseline", baseline)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(PyValueError::new_err(format!("{name}: give a number above 0, not {value}")));
            }
        }
        let size = size.map(arrays::size).transpose()?;
        let Some(principal_point) =
            principal_point.or_else(|| size.map(|size| Camera::centred(focal, size).principal_point))
        else {
            return Err(PyValueError::new_err(
                "size: give (width, height) of the images, to use their centre as the principal point, or give principal_point",
            ));
        };
        let [cx, cy] = principal_point;
        if let Some(value) = [cx, cy, doffs].into_iter().find(|value| !value.is_finite()) {
            return Err(PyValueError::new_err(format!(
                "principal_point and doffs: give finite numbers, not {value}"
            )));
        }
        let unit = calibration::unit(unit)?;
        let names = "Rig.of".to_owned();
        let rectified =
            Calibration::of_cameras(Camera { focal_length: [focal; 2], principal_point }, baseline, unit);
        tell(py, &rectified, size, &names)?;
        let unit = unit.name().into();
        Self::of_numbers(([focal; 2], principal_point, [doffs, baseline], unit, size, names, None))
    }

    /// The rig of a crop of the images whose first pixel is (x, y), such as the roi of `match`, for the maps and the left image of that
    /// crop. It accepts maps of any size.
    fn of_part(&self, x: usize, y: usize) -> PyResult<Self> {
        let (focal, [cx, cy], apart, unit, _, names, rectifying) = self.numbers();
        let principal_point = [cx - x as f64, cy - y as f64];
        Self::of_numbers((focal, principal_point, apart, unit, None, names, rectifying))
    }

    /// The depth of every pixel along the optical axis, float32 in the unit of the baseline; +inf if the disparity is masked or not finite,
    /// or if d + doffs is 0 or less.
    ///
    /// disparity: array of shape (height, width), float32 or float64, in pixels, such as Matched.disparity.
    fn depth<'py>(&self, py: Python<'py>, disparity: &Bound<PyAny>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let map = self.disparities(disparity)?;
        arrays::map(py, py.detach(|| self.rig.depths(&map)))
    }

    /// The expected error of every depth, float32 in the unit of the baseline, +inf if unknown: Z sigma / (d + doffs).
    ///
    /// disparity: as in `depth`.
    /// sigma: the errors of the disparities, an array of the same shape, in pixels, such as Matched.sigma.
    fn depth_sigma<'py>(
        &self,
        py: Python<'py>,
        disparity: &Bound<PyAny>,
        sigma: &Bound<PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let (map, sigmas) = (self.disparities(disparity)?, arrays::disparities("sigma", sigma)?);
        if map.size() != sigmas.size() {
            let [(w, h), (width, height)] = [sigmas.size(), map.size()];
            return Err(PyValueError::new_err(format!(
                "sigma: is {w} x {h}, but disparity is {width} x {height}: give maps of the same view"
            )));
        }
        arrays::map(py, py.detach(|| self.rig.depth_sigmas(&map, &sigmas)))
    }

    /// The depth of every pixel in whole millimetres, uint16, as in ROS and TUM: 0 if unknown or above 65535.
    ///
    /// disparity: as in `depth`.
    ///
    /// Raises ValueError if the unit of the baseline is unknown; set it with Calibration(..., unit="m") or Rig.of(..., unit="m").
    fn millimetres<'py>(
        &self,
        py: Python<'py>,
        disparity: &Bound<PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<u16>>> {
        let map = self.disparities(disparity)?;
        let depths = py.detach(|| self.rig.millimetres(&map)).ok_or_else(|| self.unit_unknown())?;
        arrays::map(py, depths)
    }

    /// The depths seen by a third camera, along its axis and at its pixels: float32 in the unit of the baseline, +inf where it sees
    /// something that the map does not. The nearest surface wins, and each pixel of the map covers its projected area.
    ///
    /// disparity: as in `depth`.
    /// camera: a ThirdCamera, or the path of its file. Its pose is relative to the original left camera if the rig is from a Rectification,
    ///     else to the rectified left camera.
    fn registered<'py>(
        &self,
        py: Python<'py>,
        disparity: &Bound<PyAny>,
        camera: &Bound<PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let (map, camera) = (self.disparities(disparity)?, PyThirdCamera::of(camera)?);
        arrays::map(py, py.detach(|| self.rig.registered(&map, &camera)))
    }

    /// Like `registered`, in whole millimetres as uint16, like `millimetres`, with the same ValueError.
    fn registered_millimetres<'py>(
        &self,
        py: Python<'py>,
        disparity: &Bound<PyAny>,
        camera: &Bound<PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<u16>>> {
        let (map, camera) = (self.disparities(disparity)?, PyThirdCamera::of(camera)?);
        let depths = py.detach(|| self.rig.registered_millimetres(&map, &camera));
        arrays::map(py, depths.ok_or_else(|| self.unit_unknown())?)
    }

    /// The points of measured, trusted pixels (validity 0), row by row, in the frame of the left camera: x to the right, y down, z forward.
    ///
    /// matched: the result of the match of the rectified pair.
    /// left: the rectified left image, as for `match`, for the colours; 16 bits and floats are scaled to its own range.
    fn points(&self, py: Python, matched: &Bound<PyMatched>, left: &Bound<PyAny>) -> PyResult<PyPoints> {
        let maps = matched.get().maps(py)?;
        self.check("matched", maps.disparity.size())?;
        let image = Image::of("left", left)?;
        let pair = Pair::of_frames(image.raster()?, image.raster()?).map_err(exception)?;
        if pair.size() != maps.disparity.size() {
            let ((width, height), (w, h)) = (maps.disparity.size(), pair.size());
            return Err(PyValueError::new_err(format!(
                "left: is {w} x {h} but the maps are {width} x {height}; give the rectified image that was matched"
            )));
        }
        let cloud = py.detach(|| self.rig.cloud(&maps, pair.left()));
        PyPoints::of(py, &cloud.points, cloud.unit)
    }

    /// Where the left image shows points of the scene, such as those of a lidar: float64 of shape (N, 3) with rows x, y and disparity in
    /// pixels, which `match` takes as its prior. NaN for points that are not in front of the cameras, or too near for any match. Positions
    /// may be outside the image.
    ///
    /// points: array (N, 3) of float32 or float64, in the frame and the unit of `points`. With a Rectification, points @
    ///     rectification.rotations[0].T turns those in the frame of the camera that took the left image.
    fn seen<'py>(&self, py: Python<'py>, points: &Bound<PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points = positions("points", points)?;
        let can_match = |seen: &[f64; 3]| seen[2].abs() <= f64::from(MAX_DISPARITY);
        let seen = |point: &[f64; 3]| self.rig.seen(*point).filter(can_match).unwrap_or([f64::NAN; 3]);
        let seen = points.as_chunks::<3>().0.iter().map(seen);
        let seen: Vec<f64> = seen.flatten().collect();
        seen.into_pyarray(py).reshape([points.len() / 3, 3])
    }

    /// The matrices [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] of the left and the right camera: two float64 arrays (3, 3), in pixels.
    #[getter]
    fn cameras<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let Camera { focal_length: [fx, fy], principal_point: [cx, cy] } = self.camera;
        let camera = |cx: f64| [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]];
        arrays::matrices(py, &[camera(cx), camera(cx + self.doffs)])
    }

    /// Distance of the principal points along the row, cx of the right camera minus cx of the left one, in pixels.
    #[getter]
    fn doffs(&self) -> f64 {
        self.doffs
    }

    /// Distance between the cameras, in `unit`.
    #[getter]
    fn baseline(&self) -> f64 {
        self.baseline
    }

    /// The unit of the baseline, of depths and of points: "mm", "cm", "m", or "unknown" if the calibration lacks it.
    #[getter]
    fn unit(&self) -> &'static str {
        self.rig.unit().name()
    }

    /// (width, height) of the rectified images, in pixels; None if the calibration lacks it.
    #[getter]
    fn size(&self) -> Option<(usize, usize)> {
        self.size
    }

    fn __repr__(&self) -> String {
        let unit = if self.unit() == "unknown" { "of an unknown unit" } else { self.unit() };
        format!(
            "<mrfgs.Rig: baseline {} {unit}, focal length {} px>",
            self.baseline, self.camera.focal_length[0]
        )
    }

    /// Supports `pickle` and `copy`.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Numbers,))> {
        Ok((py.get_type::<Self>().getattr("_again")?, (self.numbers(),)))
    }

    #[classmethod]
    fn _again(_: &Bound<PyType>, numbers: Numbers) -> PyResult<Self> {
        Self::of_numbers(numbers)
    }
}

/// A point cloud.
///
/// positions: array (N, 3) of float32 or float64: x, y, z.
/// colours: array (N, 3) of uint8: red, green, blue.
/// confidence: array (N,) of uint8.
/// unit: the unit of the positions, "mm", "cm", "m" or "unknown", which files record.
///
/// Rig.points makes one. To select points, write for example Points(p.positions[near], p.colours[near], p.confidence[near], p.unit).
#[pyclass(name = "Points", frozen, get_all, module = "mrfgs")]
pub(crate) struct PyPoints {
    /// The positions: float32 of shape (N, 3), x to the right, y down, z forward of the left camera, in the unit of the baseline.
    positions: Py<PyArray2<f32>>,
    /// The colours: uint8 of shape (N, 3), red, green and blue.
    colours: Py<PyArray2<u8>>,
    /// The confidences: uint8 of shape (N,), in 1/8 nat.
    confidence: Py<PyArray1<u8>>,
    /// The unit of the positions: "mm", "cm", "m", or "unknown".
    unit: String,
}

impl PyPoints {
    fn of(py: Python, points: &[Point], unit: Unit) -> PyResult<Self> {
        let count = points.len();
        let positions: Vec<f32> = points.iter().flat_map(|point| point.position).collect();
        let colours: Vec<u8> = points.iter().flat_map(|point| point.colour).collect();
        let confidence: Vec<u8> = points.iter().map(|point| point.confidence).collect();
        Ok(Self {
            positions: positions.into_pyarray(py).reshape([count, 3])?.unbind(),
            colours: colours.into_pyarray(py).reshape([count, 3])?.unbind(),
            confidence: confidence.into_pyarray(py).unbind(),
            unit: unit.name().into(),
        })
    }
}

#[pymethods]
impl PyPoints {
    #[new]
    #[pyo3(signature = (positions, colours, confidence, unit="unknown"))]
    fn new(
        py: Python,
        positions: &Bound<PyAny>,
        colours: &Bound<PyAny>,
        confidence: &Bound<PyAny>,
        unit: &str,
    ) -> PyResult<Self> {
        let positions: Vec<f32> =
            self::positions("positions", positions)?.into_iter().map(|v| v as f32).collect();
        let colours = arrays::table::<u8>("colours", colours, Some(3), "shape (N, 3), uint8")?;
        let confidence = arrays::table::<u8>("confidence", confidence, None, "shape (N,), uint8")?;
        let counts = [positions.len() / 3, colours.len() / 3, confidence.len()];
        let [count, ..] = counts;
        if counts != [count; 3] {
            return Err(PyValueError::new_err(format!(
                "{} positions, {} colours and {} confidences: give the same number of each",
                counts[0], counts[1], counts[2]
            )));
        }
        let points = (0..count).map(|i| Point {
            position: [0, 1, 2].map(|axis| positions[3 * i + axis]),
            colour: [0, 1, 2].map(|channel| colours[3 * i + channel]),
            confidence: confidence[i],
        });
        Self::of(py, &points.collect::<Vec<_>>(), calibration::unit(unit)?)
    }

    /// Writes the points as binary PLY or PCD, LAS 1.2 or LAZ, completely or not at all, like `mrfgs match --also` with `points`,
    /// `points.pcd`, `points.las` and `points.laz`. The confidence is `quality` in PLY, as in MeshLab, and 257 times the confidence is the
    /// intensity in LAS and LAZ, where positions are rounded to a millionth of the distance of the nearest point.
    ///
    /// path: a name that ends in .ply, .pcd, .las or .laz.
    ///
    /// Raises OSError if it cannot be written.
    fn save(&self, py: Python, path: PathBuf) -> PyResult<()> {
        let positions =
            arrays::table::<f32>("positions", self.positions.bind(py), Some(3), "shape (N, 3), float32")?;
        let colours = arrays::table::<u8>("colours", self.colours.bind(py), Some(3), "shape (N, 3), uint8")?;
        let confidence =
            arrays::table::<u8>("confidence", self.confidence.bind(py), None, "shape (N,), uint8")?;
        let (positions, _) = positions.as_chunks::<3>();
        let (colours, _) = colours.as_chunks::<3>();
        let points = positions.iter().zip(colours).zip(confidence);
        let points = points.map(|((&position, &colour), confidence)| Point { position, colour, confidence });
        let unit = calibration::unit(&self.unit)?;
        let cloud = Cloud { points: points.collect(), unit, ..Cloud::default() };
        py.detach(|| write::cloud(&path, &cloud)).map_err(exception)
    }

    fn __len__(&self, py: Python) -> usize {
        self.confidence.bind(py).len()
    }

    fn __repr__(&self, py: Python) -> String {
        format!("<mrfgs.Points: {}>", self.__len__(py))
    }

    /// Supports `pickle` and `copy`.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyType>, Bound<'py, PyTuple>)> {
        let all = (self.positions.bind(py), self.colours.bind(py), self.confidence.bind(py), &self.unit);
        Ok((py.get_type::<Self>(), all.into_pyobject(py)?))
    }
}
