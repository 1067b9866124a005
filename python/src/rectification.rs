//! Rectification of raw pairs.

use std::sync::OnceLock;

use mrfgs::calibration::write;
use mrfgs::image::calib::Calibration;
use mrfgs::rectification::{Correspondence, Options, Rectification};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};

use crate::arrays::{self, Image};
use crate::calibration::PyCalibration;
use crate::depth::PyRig;
use crate::exceptions::{self, exception};
use crate::words;

/// Turns raw images into rectified pairs. It is computed once and applies to any number of pairs.
///
/// calibration: a Calibration, the path of a calibration file, or a list of two paths.
/// size: (width, height) of the images, in pixels; None uses that of the calibration, which may differ between the cameras.
/// alpha: from 0, where the rectified views have no empty borders, to 1, where they contain all pixels of the images. None uses the
///     rectification in the calibration if there is one, else one that keeps the focal length (fisheyes: 0).
/// zero_disparity: whether both views have the same principal point, so that points at infinity have disparity 0.
///
/// The views are those of OpenCV's stereoRectify. If one camera is above the other, both views are rotated by 90 degrees so that matching
/// points share a row. Raises ValueError for a calibration that gives no rectified pair or is for another size. Probable faults of the
/// calibration are reported as a MatchWarning.
#[pyclass(name = "Rectification", frozen, module = "mrfgs")]
pub(crate) struct PyRectification {
    by: Rectification,
    /// A copy with cached source positions, from the first pair on.
    kept: OnceLock<Rectification>,
    /// The arguments, for copies: calibration or matches, image sizes, and options.
    made_of: (Source, [(usize, usize); 2], Options),
    /// The turns of the right camera since then, in order.
    turns: Vec<[f64; 3]>,
    /// Calibration and rig of the rectified pair; `None` without a calibration.
    known: Option<(Calibration, Py<PyRig>)>,
}

/// The basis of a rectification.
#[derive(Clone, FromPyObject, IntoPyObject)]
#[allow(clippy::large_enum_variant, reason = "there is one for each rectification")]
enum Source {
    Calibration(PyCalibration),
    Matches(Vec<Correspondence>),
}

impl PyRectification {
    fn of(py: Python, source: Source, sizes: [(usize, usize); 2], options: Options) -> PyResult<Self> {
        let (by, known) = match &source {
            Source::Calibration(known) => {
                let by = Rectification::of_sizes(&known.cameras, sizes, &options)
                    .map_err(|error| known.wrong(error))?;
                let calibration = by.calibration().map_err(|error| known.wrong(error))?;
                let [rectifying, _] = *by.rotations();
                let rig = Py::new(py, PyRig::of_rectified(&calibration, Some(rectifying), known)?)?;
                (by, Some((calibration, rig)))
            }
            Source::Matches(matches) => {
                let by = py
                    .detach(|| Rectification::of_matches(matches, sizes[0], &options))
                    .map_err(exception)?;
                (by, None)
            }
        };
        Ok(Self { by, kept: OnceLock::new(), made_of: (source, sizes, options), turns: Vec::new(), known })
    }

    /// A copy for a rig whose right camera has turned about `axis`, whose length is the angle.
    pub(crate) fn with_right_turned(&self, py: Python, axis: [f64; 3]) -> PyResult<Self> {
        let Self { by, made_of, turns, known, .. } = self;
        Ok(Self {
            by: by.with_right_turned(axis).map_err(exception)?,
            kept: OnceLock::new(),
            made_of: made_of.clone(),
            turns: turns.iter().copied().chain([axis]).collect(),
            known: known.as_ref().map(|(calibration, rig)| (calibration.clone(), rig.clone_ref(py))),
        })
    }

    /// The library's rectification.
    pub(crate) fn by(&self) -> &Rectification {
        &self.by
    }

    /// Caches the source positions, as many pairs may follow the first.
    fn with_places(&self) -> mrfgs::Result<&Rectification> {
        if let Some(kept) = self.kept.get() {
            return Ok(kept);
        }
        let mut by = self.by.clone();
        by.keep_places()?;
        Ok(self.kept.get_or_init(|| by))
    }

    /// Calibration and rig, for everything that needs a scale.
    fn known(&self) -> PyResult<&(Calibration, Py<PyRig>)> {
        self.known.as_ref().ok_or_else(|| {
            PyValueError::new_err(
                "the pair was rectified without a calibration, so there is no scale; for depth, make a Rectification from a calibration",
            )
        })
    }
}

#[pymethods]
impl PyRectification {
    #[new]
    #[pyo3(signature = (calibration, size=None, *, alpha=None, zero_disparity=true))]
    fn new(
        py: Python,
        calibration: &Bound<PyAny>,
        size: Option<&Bound<PyAny>>,
        alpha: Option<f64>,
        zero_disparity: bool,
    ) -> PyResult<Self> {
        let options = options(alpha, zero_disparity)?;
        let known = PyCalibration::of(calibration)?;
        let sizes = match size {
            Some(size) => [arrays::size(size)?; 2],
            None => known.cameras.sizes().ok_or_else(|| {
                let names = &known.names;
                PyValueError::new_err(format!(
                    "size: {names} lacks the size of the images; give (width, height)"
                ))
            })?,
        };
        let made = Self::of(py, Source::Calibration(known), sizes, options)?;
        if let Source::Calibration(PyCalibration { names, .. }) = &made.made_of.0 {
            exceptions::tell(py, made.by.doubts().iter().map(|doubt| words::doubt(doubt, names)))?;
        }
        Ok(made)
    }

    /// Rectifies a pair from its own matches, without a calibration: two photos taken side by side with one hand-held camera, turned by a
    /// few degrees at most.
    ///
    /// left, right: arrays as for `match`, upright: rotate photos by their EXIF orientation first.
    /// mask: array of shape (height, width): nonzero pixels of the left image are ignored.
    /// no_data: a value for no data, in both images.
    /// alpha, zero_disparity: as for Rectification.
    ///
    /// `trust` tells how reliable it is. There is no scale, so `rig` raises ValueError. Raises ValueError if too few matches agree, if they
    /// show no depth (a flat surface, or a camera that only turned), or if the camera moved forward. Doubts are reported as a MatchWarning.
    #[staticmethod]
    #[pyo3(signature = (left, right, *, mask=None, no_data=None, alpha=None, zero_disparity=true))]
    fn of_pair(
        py: Python,
        left: &Bound<PyAny>,
        right: &Bound<PyAny>,
        mask: Option<&Bound<PyAny>>,
        no_data: Option<f64>,
        alpha: Option<f64>,
        zero_disparity: bool,
    ) -> PyResult<Self> {
        let options = options(alpha, zero_disparity)?;
        let [left, right] = Image::both(left, right)?;
        let pair = arrays::pair(&left, &right, mask, no_data)?;
        let matches = py.detach(|| Rectification::matches_of(&pair)).map_err(exception)?;
        let made = Self::of(py, Source::Matches(matches), pair.own_sizes(), options)?;
        exceptions::tell(py, made.by.doubts().iter().map(ToString::to_string))?;
        Ok(made)
    }

    /// Rectifies a pair, and returns the left and the right view as masked arrays: masked where a pixel has no source or an ignored one.
    /// `match` ignores masked pixels; `.data` and `.mask` are plain arrays.
    ///
    /// left, right: arrays as for `match`, of the size of the rectification.
    /// mask: array of shape (height, width): nonzero pixels of the left image are ignored.
    /// no_data: a value for no data, in both images.
    ///
    /// The views have shape (height, width) or (height, width, 3), without alpha. Two uint8 images give uint8 views; others give uint16
    /// scaled as for `match`, floats from 0 to 65280. The values are those of the files that `mrfgs rectify` writes. Raises ValueError for
    /// images of another size.
    #[pyo3(signature = (left, right, *, mask=None, no_data=None))]
    fn apply<'py>(
        &self,
        py: Python<'py>,
        left: &Bound<'py, PyAny>,
        right: &Bound<'py, PyAny>,
        mask: Option<&Bound<PyAny>>,
        no_data: Option<f64>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let [left, right] = Image::both(left, right)?;
        let stored = [left.stored(&right), right.stored(&left)];
        let pair = arrays::raw_pair(&left, &right, mask, no_data)?;
        let pair = py.detach(|| self.with_places()?.apply(&pair)).map_err(exception)?;
        let [left, right] = arrays::images(py, &pair, stored)?;
        Ok((left, right))
    }

    /// The source position of each pixel of the rectified views: ((left_x, left_y), (right_x, right_y)), float32, in pixels, of shape
    /// (height, width); +inf without a source. Suitable for cv2.remap. Raises MemoryError if they do not fit.
    fn maps<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyTuple>, Bound<'py, PyTuple>)> {
        let [left, right] = py.detach(|| self.by.maps()).map_err(exception)?;
        let both = |[x, y]: [_; 2]| PyTuple::new(py, [arrays::map(py, x)?, arrays::map(py, y)?]);
        Ok((both(left)?, both(right)?))
    }

    /// (width, height) of the rectified views, in pixels.
    #[getter]
    fn size(&self) -> (usize, usize) {
        self.by.size()
    }

    /// (width, height) of the raw left images, in pixels; that of the right ones may differ.
    #[getter]
    fn raw_size(&self) -> (usize, usize) {
        self.made_of.1[0]
    }

    /// The rotations from each camera's frame to that of its rectified view: two arrays (3, 3), left and right, R1 and R2 in OpenCV.
    #[getter]
    fn rotations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        arrays::matrices(py, self.by.rotations())
    }

    /// The cameras of the rectified pair as a Rig, for depth and points. Raises ValueError without a calibration.
    #[getter]
    fn rig(&self, py: Python) -> PyResult<Py<PyRig>> {
        Ok(self.known()?.1.clone_ref(py))
    }

    /// How reliable a rectification without a calibration is; None with one. A dictionary: the number of `matches`, the number `agreeing`,
    /// the `median` and `percentile95` of the row errors of these (pixels), their `coverage` of the image, and the share `off_one_plane` (0
    /// to 1).
    #[getter]
    fn trust<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(trust) = self.by.trust() else { return Ok(None) };
        let all = PyDict::new(py);
        all.set_item("matches", trust.matches)?;
        all.set_item("agreeing", trust.agreeing)?;
        all.set_item("median", trust.median)?;
        all.set_item("percentile95", trust.percentile95)?;
        all.set_item("coverage", trust.coverage)?;
        all.set_item("off_one_plane", trust.off_one_plane)?;
        Ok(Some(all))
    }

    /// The calibration of the rectified pair as the text of a Middlebury calib.txt, in millimetres if the unit is known. Raises ValueError
    /// without a calibration.
    fn calib_txt(&self) -> PyResult<String> {
        Ok(write::middlebury(&self.known()?.0).unwrap_or_default())
    }

    /// The calibration of the rectified pair as the text of an OpenCV YAML file, in the unit of the calibration: K1, D1, R1, P1, K2, D2,
    /// R2, P2, R, T, Q, and the rotations fromRaw1 and fromRaw2. Raises ValueError without a calibration.
    fn cameras_yml(&self) -> PyResult<String> {
        Ok(write::opencv(&self.known()?.0, self.by.rotations()).unwrap_or_default())
    }

    fn __repr__(&self) -> String {
        let ((w, h), (width, height)) = (self.raw_size(), self.size());
        format!("<mrfgs.Rectification: {w} x {h} to {width} x {height}>")
    }

    /// Pickles the arguments: recomputing gives the same bits everywhere.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (source, sizes, Options { alpha, zero_disparity }) = self.made_of.clone();
        let again = py.get_type::<Self>().getattr("_again")?;
        let turns = self.turns.clone();
        Ok((again, (source, sizes, alpha, zero_disparity, turns).into_pyobject(py)?))
    }

    /// The constructor without repeated warnings.
    #[classmethod]
    fn _again(
        of: &Bound<PyType>,
        source: Source,
        sizes: [(usize, usize); 2],
        alpha: Option<f64>,
        zero_disparity: bool,
        turns: Vec<[f64; 3]>,
    ) -> PyResult<Self> {
        let made = Self::of(of.py(), source, sizes, Options { alpha, zero_disparity })?;
        turns.into_iter().try_fold(made, |made, axis| made.with_right_turned(of.py(), axis))
    }
}

fn options(alpha: Option<f64>, zero_disparity: bool) -> PyResult<Options> {
    match alpha.filter(|alpha| !(0.0..=1.0).contains(alpha)) {
        Some(alpha) => Err(PyValueError::new_err(format!("alpha: give a number from 0 to 1, not {alpha}"))),
        None => Ok(Options { alpha, zero_disparity }),
    }
}
