//! Rigs that drift, and how they are put right.

use mrfgs::drift::Drift;
use mrfgs::low_level::process::Turns;
use mrfgs::options::DisparityRange;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays::{self, Image};
use crate::exceptions::exception;
use crate::range;
use crate::rectification::PyRectification;

/// What the frames of a rig show of how its right camera has turned since it was calibrated. Shocks and warmth turn cameras by tenths of a
/// degree; then rows no longer line up, and maps get holes and errors.
///
/// rectification: that of the calibration. Raises ValueError of one by matches alone.
///
/// Give it each frame, and go on with what `correct` returns: what `mrfgs sequence --recalibrate` does.
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

    /// Takes the next frame. It looks at the first, the fourth, the sixteenth, and then at every 64th; of these the last 16 count.
    ///
    /// left, right: the rectified views, by what `correct` returned last; before that by the rectification of the calibration.
    /// max_disparity, min_disparity: the disparities that they have, in pixels; None is 0 for min_disparity.
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

    /// How the right camera has turned since the calibration, as far as the last frames show it; None where they have too few matches. A
    /// dictionary: how far it looks up, to the right and clockwise, and the standard errors of these (`degrees`, `errors`), how far that
    /// moves `rows` apart at most (pixels), how many `matches` show it, and whether it `counts`: it moves rows by 0.1 px or more, and
    /// is no chance.
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

    /// The Rectification of the next frames, where that is no longer what rectified the last ones; else None. It is that of the calibration
    /// with the right camera turned; its `rig` is the same.
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
