//! Tracking of rigs whose right camera turns, and correction of their rectification.

use mrfgs::drift::Drift;
use mrfgs::low_level::process::Turns;
use mrfgs::options::DisparityRange;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays::{self, Image};
use crate::exceptions::exception;
use crate::range;
use crate::rectification::PyRectification;

/// Measures how the right camera of a rig has turned since its calibration. Shocks and heat turn cameras by tenths of a degree; rows then
/// no longer line up, and maps get holes and errors.
///
/// rectification: that of the calibration. Raises ValueError for a rectification without a calibration.
///
/// Pass it each frame, and continue with the result of `correct`, as `mrfgs sequence --recalibrate` does.
#[pyclass(name = "Drift", frozen, module = "mrfgs")]
pub(crate) struct PyDrift {
    calibrated: Py<PyRectification>,
    drift: Turns<Drift>,
}

#[pymethods]
impl PyDrift {
    #[new]
    fn new(rectification: Py<PyRectification>) -> PyResult<Self> {
        let drift = Drift::of(rectification.get().by()).map_err(exception)?;
        Ok(Self { calibrated: rectification, drift: Turns::new(drift) })
    }

    /// Takes the next frame. It evaluates the first, fourth and sixteenth, then every 64th, and uses the last 16 of these.
    ///
    /// left, right: the views, rectified by the last result of `correct`, or before that by the rectification of the calibration.
    /// max_disparity, min_disparity: the range of their disparities, in pixels; min_disparity defaults to 0.
    #[pyo3(signature = (left, right, max_disparity, *, min_disparity=None))]
    fn follow(
        &self,
        py: Python,
        left: &Bound<PyAny>,
        right: &Bound<PyAny>,
        max_disparity: &Bound<PyAny>,
        min_disparity: Option<&Bound<PyAny>>,
    ) -> PyResult<()> {
        let [min, max] = [("min_disparity", min_disparity), ("max_disparity", Some(max_disparity))]
            .map(|(name, given)| range::pixels(name, given));
        let range = DisparityRange::new(min?.unwrap_or(0), max?.unwrap_or(0)).map_err(exception)?;
        let [left, right] = Image::both(left, right)?;
        let pair = arrays::pair(&left, &right, None, None)?;
        py.detach(|| self.drift.turn()?.follow(&pair, range)).map_err(exception)
    }

    /// How the right camera has turned since the calibration, according to the last frames; None if they have too few matches. A
    /// dictionary: the turn up, right and clockwise (`degrees`) and its standard errors (`errors`), the largest resulting shift of `rows`
    /// (pixels), the number of `matches`, and whether the turn `counts`: it shifts rows by at least 0.1 px and is significant.
    #[getter]
    fn turn<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let turn = py.detach(|| Ok(self.drift.turn()?.turn())).map_err(exception)?;
        let Some(turn) = turn else { return Ok(None) };
        let all = PyDict::new(py);
        all.set_item("degrees", PyTuple::new(py, turn.degrees())?)?;
        all.set_item("errors", PyTuple::new(py, turn.errors.map(f64::to_degrees))?)?;
        all.set_item("rows", turn.rows)?;
        all.set_item("matches", turn.matches)?;
        all.set_item("counts", turn.counts())?;
        Ok(Some(all))
    }

    /// The Rectification for the next frames, if it differs from the last one; else None. It is that of the calibration with the right
    /// camera turned, and has the same `rig`.
    fn correct(&self, py: Python) -> PyResult<Option<PyRectification>> {
        let calibrated = self.calibrated.get();
        let axis = py.detach(|| {
            let mut drift = self.drift.turn()?;
            let corrected = drift.correct(calibrated.by())?;
            Ok(corrected.and(drift.turn()).map(|turn| turn.axis))
        });
        axis.map_err(exception)?.map(|axis| calibrated.with_right_turned(py, axis)).transpose()
    }

    fn __repr__(&self) -> &'static str {
        "<mrfgs.Drift>"
    }
}
