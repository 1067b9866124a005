//! The maps of a pair.

use mrfgs::Matched;
use mrfgs::image::Plane;
use mrfgs::maps::Maps;
use numpy::{PyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};

use crate::{arrays, words};

/// The maps of a pair, of shape (height, width), and how they were computed.
#[pyclass(name = "Matched", frozen, get_all, module = "mrfgs")]
pub(crate) struct PyMatched {
    /// Disparity in pixels, float32, +inf if unknown.
    pub(crate) disparity: Py<PyArray2<f32>>,
    /// Disparity before post-processing in pixels, float32, +inf where the left image is masked.
    raw: Py<PyArray2<f32>>,
    /// How sure each pixel is, uint8: the lead of the best disparity over the runner-up in 1/8 nat, averaged over neighbouring pixels
    /// (those with another disparity count 0). 0 for pixels without a measurement.
    pub(crate) confidence: Py<PyArray2<u8>>,
    /// The expected error of every measured disparity in pixels, float32, from its confidence: about two thirds of the errors are smaller.
    /// +inf for pixels without a measurement.
    pub(crate) sigma: Py<PyArray2<f32>>,
    /// The status of each pixel, uint8: the sum of 1 match outside the right image, 2 occluded, 4 in a small region, 8 low confidence, 16
    /// filled (alone: a prior gave it), 32 masked, 64 a tie of two disparities, 128 outvoted by neighbouring pixels; 0 is measured and trusted.
    pub(crate) validity: Py<PyArray2<u8>>,
    /// Disparity of the right view in pixels, float32, +inf if unknown: right (x, y) with disparity d appears at left (x + d, y). None
    /// without the option "right-map".
    right: Option<Py<PyArray2<f32>>>,
    /// Smallest disparity that was searched, in pixels.
    min_disparity: i32,
    /// Largest disparity that was searched, in pixels.
    max_disparity: i32,
    /// Number of iterations, over all phases.
    iterations: u32,
    /// Number of tiles that the image was split into.
    tiles: usize,
    /// The device.
    ran_on: String,
    /// Why the preferred device was not used, else None.
    note: Option<String>,
}

impl PyMatched {
    pub(crate) fn of(py: Python, matched: Matched) -> PyResult<Self> {
        let range = matched.range();
        let sigma = arrays::map(py, matched.sigma())?.unbind();
        let right = matched.maps.right_map().map(|map| arrays::map(py, map)).transpose()?;
        Ok(Self {
            right: right.map(Bound::unbind),
            disparity: arrays::map(py, matched.maps.final_map())?.unbind(),
            raw: arrays::map(py, matched.maps.raw_map())?.unbind(),
            confidence: arrays::map(py, matched.maps.confidence)?.unbind(),
            sigma,
            validity: arrays::map(py, matched.maps.validity)?.unbind(),
            min_disparity: range.min,
            max_disparity: range.max,
            iterations: matched.iterations,
            tiles: matched.tiles.count(),
            ran_on: matched.ran_on,
            note: matched.note.as_ref().map(words::error),
        })
    }

    /// The maps with the arrays' current values; `raw` is not included.
    pub(crate) fn maps(&self, py: Python) -> PyResult<Maps> {
        let disparity = arrays::disparities("matched.disparity", self.disparity.bind(py).as_any())?;
        let confidence = arrays::bytes("matched.confidence", self.confidence.bind(py).as_any())?;
        let validity = arrays::bytes("matched.validity", self.validity.bind(py).as_any())?;
        let size = disparity.size();
        if [confidence.size(), validity.size()] != [size; 2] {
            return Err(PyValueError::new_err(
                "matched: its maps differ in size; give the result of a match",
            ));
        }
        Ok(Maps::from_pixels(&disparity, confidence, validity))
    }

    /// A copy with other disparities.
    pub(crate) fn with_disparity(&self, py: Python, disparity: Plane<f32>) -> PyResult<Self> {
        Ok(Self {
            disparity: arrays::map(py, disparity)?.unbind(),
            raw: self.raw.clone_ref(py),
            confidence: self.confidence.clone_ref(py),
            sigma: self.sigma.clone_ref(py),
            validity: self.validity.clone_ref(py),
            right: self.right.as_ref().map(|right| right.clone_ref(py)),
            ran_on: self.ran_on.clone(),
            note: self.note.clone(),
            ..*self
        })
    }
}

#[pymethods]
impl PyMatched {
    #[new]
    #[allow(clippy::too_many_arguments, reason = "its fields")]
    fn new(
        disparity: Py<PyArray2<f32>>,
        raw: Py<PyArray2<f32>>,
        confidence: Py<PyArray2<u8>>,
        sigma: Py<PyArray2<f32>>,
        validity: Py<PyArray2<u8>>,
        right: Option<Py<PyArray2<f32>>>,
        min_disparity: i32,
        max_disparity: i32,
        iterations: u32,
        tiles: usize,
        ran_on: String,
        note: Option<String>,
    ) -> Self {
        Self {
            disparity,
            raw,
            confidence,
            sigma,
            validity,
            right,
            min_disparity,
            max_disparity,
            iterations,
            tiles,
            ran_on,
            note,
        }
    }

    /// Supports `pickle` and `copy`.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyType>, Bound<'py, PyTuple>)> {
        let (d, r, c) = (self.disparity.bind(py), self.raw.bind(py), self.confidence.bind(py));
        let (s, v) = (self.sigma.bind(py), self.validity.bind(py));
        let Self { min_disparity, max_disparity, iterations, tiles, ran_on, note, .. } = self;
        let right = self.right.as_ref().map(|right| right.bind(py));
        let all =
            (d, r, c, s, v, right, min_disparity, max_disparity, iterations, tiles, ran_on, note.as_deref());
        Ok((py.get_type::<Self>(), all.into_pyobject(py)?))
    }

    fn __repr__(&self, py: Python) -> String {
        let shape = self.disparity.bind(py).shape();
        let (height, width) = (shape[0], shape[1]);
        let Self { min_disparity, max_disparity, ran_on, .. } = self;
        format!(
            "<mrfgs.Matched: {width} x {height}, disparities {min_disparity} to {max_disparity}, on {ran_on}>"
        )
    }
}
