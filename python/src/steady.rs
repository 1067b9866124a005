//! Temporal smoothing of video.

use mrfgs::image::Pair;
use mrfgs::low_level::process::Turns;
use mrfgs::steady::Steady;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::Image;
use crate::exceptions::exception;
use crate::matched::PyMatched;

/// A filter for the maps of a sequence that steadies still surfaces: where the left image does not change, disparities are averaged with
/// earlier frames, weighted by confidence. Moving regions keep the disparities of their own frame.
#[pyclass(name = "Steady", frozen, module = "mrfgs")]
#[derive(Default)]
pub(crate) struct PySteady(Turns<Steady>);

#[pymethods]
impl PySteady {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// Returns a copy of `matched` with smoothed disparities; for 8-bit images they equal those of `mrfgs sequence --steady`. Raw,
    /// confidence, sigma, validity and right are not smoothed.
    ///
    /// matched: the result for the next frame. Another image size starts a new sequence.
    /// left: the left image that was matched. Images of more than 8 bits are scaled by their own values, unlike in the program, which uses
    /// both views.
    fn follow(&self, py: Python, matched: &Bound<PyMatched>, left: &Bound<PyAny>) -> PyResult<PyMatched> {
        let matched = matched.get();
        let mut maps = matched.maps(py)?;
        let image = Image::of("left", left)?;
        let pair = Pair::of_frames(image.raster()?, image.raster()?).map_err(exception)?;
        if pair.size() != maps.disparity.size() {
            let ((width, height), (w, h)) = (maps.disparity.size(), pair.size());
            return Err(PyValueError::new_err(format!(
                "left: is {w} x {h} but the maps are {width} x {height}; give the image that was matched"
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
