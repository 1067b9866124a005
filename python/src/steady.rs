//! Video that holds still where the scene does.

use mrfgs::image::Pair;
use mrfgs::low_level::process::Turns;
use mrfgs::steady::Steady;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::Image;
use crate::exceptions::exception;
use crate::matched::PyMatched;

/// A filter for the maps of a sequence: where the left image does not change, the disparity follows that of the frames before, weighted by
/// confidence, so that still surfaces flicker less. Where something moves, it is that of the frame alone.
#[pyclass(name = "Steady", frozen, module = "mrfgs")]
#[derive(Default)]
pub(crate) struct PySteady(Turns<Steady>);

#[pymethods]
impl PySteady {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// The same Matched with disparities that follow those of the frames before: for images of 8 bits the maps of `mrfgs sequence
    /// --steady`. Raw, confidence, sigma, validity and right stay those of the frame alone.
    ///
    /// matched: what the match of the next frame has returned. One of another size begins a new sequence.
    /// left: the left image that was matched. Deeper ones are scaled by their own values, where the program looks at both views.
    fn follow(&self, py: Python, matched: &Bound<PyMatched>, left: &Bound<PyAny>) -> PyResult<PyMatched> {
        let matched = matched.get();
        let mut maps = matched.maps(py)?;
        let image = Image::of("left", left)?;
        let pair = Pair::of_frames(image.raster()?, image.raster()?).map_err(exception)?;
        if pair.size() != maps.disparity.size() {
            let ((width, height), (w, h)) = (maps.disparity.size(), pair.size());
            return Err(PyValueError::new_err(format!(
                "left: is {w} x {h} and the maps are {width} x {height}; give the image that was matched"
            )));
        }
        py.detach(|| {
            self.0.turn()?.follow(pair.left(), &mut maps);
            Ok(())
        })
        .map_err(exception)?;
        matched.with_disparity(py, maps.final_map())
    }

    fn __repr__(&self) -> &'static str {
        "<mrfgs.Steady>"
    }
}
