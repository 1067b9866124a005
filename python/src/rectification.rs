//! Rectified pairs of what two cameras saw.

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

/// How images as the cameras took them become a rectified pair. It is found once, and applied to any number of pairs.
///
/// calibration: a Calibration, the path of a calibration file, or a list of the paths of two.
/// size: (width, height) of the images, in pixels; None takes that of the calibration, whose cameras may have images of two sizes.
/// alpha: from 0, where every pixel of the rectified views has a source, to 1, where no pixel of the images is lost. None takes the
///     rectification of the calibration where it has one, else one that keeps the focal length (fisheyes: 0).
/// zero_disparity: whether both views have the same principal point, so that what is infinitely far has a disparity of 0.
///
/// The views are those of OpenCV's stereoRectify. Where one camera is above the other, both views are turned by a quarter, so that
/// matches are on the same row. Raises ValueError for a calibration that gives no rectified pair, and for one of another size. What is
/// probably wrong with it is told as a MatchWarning.
#[pyclass(name = "Rectification", frozen, module = "mrfgs")]
pub(crate) struct PyRectification {
    by: Rectification,
    /// The same with its places, from the first pair on.
    kept: OnceLock<Rectification>,
    /// What it was made of, for copies: calibration or matches, the size of the images, and the options.
    made_of: (Source, [(usize, usize); 2], Options),
    /// How its right camera has turned since, one turn after the other.
    turns: Vec<[f64; 3]>,
    /// What is known of the rectified pair, unless it comes from matches alone.
    known: Option<(Calibration, Py<PyRig>)>,
}

/// What a rectification follows from.
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

    /// The same of a rig whose right camera has turned about this axis, as long as the angle.
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

    /// The rectification of the library.
    pub(crate) fn by(&self) -> &Rectification {
        &self.by
    }

    /// Many pairs may follow the first, so it finds out once where pixels come from.
    fn with_places(&self) -> mrfgs::Result<&Rectification> {
        if let Some(kept) = self.kept.get() {
            return Ok(kept);
        }
        let mut by = self.by.clone();
        by.keep_places()?;
        Ok(self.kept.get_or_init(|| by))
    }

    /// What takes a scale.
    fn known(&self) -> PyResult<&(Calibration, Py<PyRig>)> {
        self.known.as_ref().ok_or_else(|| {
            PyValueError::new_err(
                "the pair was rectified by its own matches, which show no scale; for depth, make a Rectification of a calibration",
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
                    "size: {names} does not say the size of the images; give (width, height)"
                ))
            })?,
        };
        let made = Self::of(py, Source::Calibration(known), sizes, options)?;
        if let Source::Calibration(PyCalibration { names, .. }) = &made.made_of.0 {
            exceptions::tell(py, made.by.doubts().iter().map(|doubt| words::doubt(doubt, names)))?;
        }
        Ok(made)
    }

    /// The rectification of a pair by matches of its own, without a calibration: of two photographs of one camera that was moved to the
    /// side by hand, and turned by some degrees at most.
    ///
    /// left, right: arrays as `match` takes them, as they are seen: turn photographs upright by their EXIF orientation first.
    /// mask: array of the shape (height, width) of left: where it is not 0 left is ignored.
    /// no_data: a value that stands for no data in both images.
    /// alpha, zero_disparity: as of Rectification.
    ///
    /// `trust` says how far it can be trusted. There is no scale, so `rig` raises ValueError. Raises ValueError where too few matches
    /// agree, where they show no depth (one flat surface, or a camera that turned on the spot), and where the camera moved forward. What
    /// makes it doubtful is told as a MatchWarning.
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

    /// Rectifies a pair, and returns the left and the right view as masked arrays: masked where there is no source, or where the
    /// source is ignored. `match` ignores such pixels; `.data` and `.mask` are plain arrays.
    ///
    /// left, right: arrays as `match` takes them, of the size of the rectification.
    /// mask: array of the shape (height, width) of left: where it is not 0 left is ignored.
    /// no_data: a value that stands for no data in both images.
    ///
    /// The views have shape (height, width) or (height, width, 3), and no alpha. Those of two uint8 images are uint8; all others are
    /// uint16 and fill its range, as `match` takes them: the least to the largest value of floats are 0 to 65280. The values are those
    /// of the files that `mrfgs rectify` writes. Raises ValueError for images of another size.
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

    /// Where each pixel of the rectified views is in the images: ((left_x, left_y), (right_x, right_y)), float32, in pixels, of shape
    /// (height, width); +inf where it is nowhere. cv2.remap takes them. Raises MemoryError where they do not fit.
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

    /// (width, height) of the left images that it rectifies, in pixels; that of the right ones may be another.
    #[getter]
    fn raw_size(&self) -> (usize, usize) {
        self.made_of.1[0]
    }

    /// The rotations from the frame of each camera to that of its rectified view: two arrays (3, 3), left and right, R1 and R2 of
    /// OpenCV.
    #[getter]
    fn rotations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        arrays::matrices(py, self.by.rotations())
    }

    /// The cameras of the rectified pair, as a Rig: for depth and points. Raises ValueError of a rectification by matches alone.
    #[getter]
    fn rig(&self, py: Python) -> PyResult<Py<PyRig>> {
        Ok(self.known()?.1.clone_ref(py))
    }

    /// How far a rectification by matches alone can be trusted; None of one by a calibration. A dictionary: `matches`, how many of them
    /// are `agreeing`, the `median` and `percentile95` of how far apart the rows of these are (pixels), their `coverage` of the image, and
    /// the share of them that is `off_one_plane` (0 to 1).
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

    /// The calibration of the rectified pair in Middlebury's form, in millimetres where the unit is known: the text of calib.txt.
    /// Raises ValueError of a rectification by matches alone.
    fn calib_txt(&self) -> PyResult<String> {
        Ok(write::middlebury(&self.known()?.0).unwrap_or_default())
    }

    /// The same for OpenCV, in the unit of the calibration: the text of a YAML file with K1, D1, R1, P1, K2, D2, R2, P2, R, T, Q, and the
    /// rotations as fromRaw1 and fromRaw2. Raises ValueError of a rectification by matches alone.
    fn cameras_yml(&self) -> PyResult<String> {
        Ok(write::opencv(&self.known()?.0, self.by.rotations()).unwrap_or_default())
    }

    fn __repr__(&self) -> String {
        let ((w, h), (width, height)) = (self.raw_size(), self.size());
        format!("<mrfgs.Rectification: {w} x {h} to {width} x {height}>")
    }

    /// How `pickle` and `copy` make another one. It is found again: the same calibration or matches give the same bits everywhere.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (source, sizes, Options { alpha, zero_disparity }) = self.made_of.clone();
        let again = py.get_type::<Self>().getattr("_again")?;
        let turns = self.turns.clone();
        Ok((again, (source, sizes, alpha, zero_disparity, turns).into_pyobject(py)?))
    }

    /// As the constructor, without saying a second time what is probably wrong.
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
