//! Evaluation of maps against the ground truth.

use std::path::PathBuf;

use mrfgs::evaluation::{self, GroundTruth, Metrics};
use mrfgs::image::read::{Reader, read_disparity as read};
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::exceptions::exception;

/// Reads a disparity map, of any matcher or a ground truth.
///
/// path: a PFM or float TIFF in pixels, or a 16-bit PNG as in KITTI, with disparity times 256 and 0 for unknown. The scale in the header of
///     a PFM is ignored, as in Middlebury's files; cv2.imread multiplies by it.
///
/// Returns a float32 array of shape (height, width), in pixels; +inf if unknown. Raises FileNotFoundError if the file does not exist, and
/// ValueError if it does not contain disparities.
#[pyfunction]
#[pyo3(signature = (path, /))]
pub(crate) fn read_disparity(py: Python, path: PathBuf) -> PyResult<Bound<PyArray2<f32>>> {
    let map = py.detach(|| read(&path)).map_err(exception)?;
    arrays::map(py, map)
}

/// Reads an image for `match`: PNG, JPEG, PNM, TIFF or PFM, as the program reads it.
///
/// path: the file.
/// orient: whether to rotate it upright according to its EXIF or TIFF orientation tag; leave rectified pairs as stored.
///
/// Returns an array of shape (height, width), or (height, width, channels) with grey and alpha, RGB, or RGBA: uint8 for up to 8 bits,
/// uint16 for 9 to 16, float32 and float64 for floats, and float64 for wider or signed integers; a masked array if a TIFF file marks pixels
/// as no data. Raises FileNotFoundError if the file does not exist, and ValueError if it is not an image.
#[pyfunction]
#[pyo3(signature = (path, /, *, orient=false))]
pub(crate) fn read_image(py: Python, path: PathBuf, orient: bool) -> PyResult<Bound<PyAny>> {
    let raster = py.detach(|| Reader { orient, ..Reader::default() }.raster(&path)).map_err(exception)?;
    arrays::stored(py, &raster)
}

/// Compares a disparity map with the ground truth, as `mrfgs evaluate map` does.
///
/// disparity: array of shape (height, width), float32 or float64, in pixels, from any matcher; masked and non-finite pixels are invalid.
/// truth: the true disparities, an array of the same shape; masked and non-finite pixels are unknown and do not count.
/// mask: array of the same shape that marks pixels seen by both views: bool, or uint8 with 255 there, as in mask0nocc.png.
///
/// Returns a dict of two dicts: "all" for every pixel with known truth, and "nonocc" for those seen by both views, or None without a mask
/// or without such pixels. Each contains
///
/// pixels: the number of pixels,
/// density: the share of valid pixels, in percent,
/// avg, rms: mean and root mean square of the errors of valid pixels, in pixels,
/// psnr: 10 log10(255^2 / MSE) of valid pixels, in dB,
/// bad0.5, bad1.0, bad2.0, bad4.0: the share of pixels wrong by more than this many pixels or invalid, in percent,
/// a50, a90, a95, a99: the error that this percentage of valid pixels stays below, in pixels.
///
/// Undefined figures are None: all errors without valid pixels, and the PSNR of a perfect map. Raises ValueError if sizes differ or no
/// truth is known, and TypeError for arrays of other types.
#[pyfunction]
#[pyo3(signature = (disparity, truth, mask=None))]
pub(crate) fn evaluate<'py>(
    py: Python<'py>,
    disparity: &Bound<PyAny>,
    truth: &Bound<PyAny>,
    mask: Option<&Bound<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (estimate, truth) =
        (arrays::disparities("disparity", disparity)?, arrays::disparities("truth", truth)?);
    let mask = mask.map(arrays::visible).transpose()?;
    let report = py.detach(|| GroundTruth::new(truth, mask)?.evaluate(&estimate)).map_err(exception)?;
    let found = PyDict::new(py);
    found.set_item("all", figures(py, &report.all)?)?;
    found.set_item("nonocc", report.nonocc.map(|metrics| figures(py, &metrics)).transpose()?)?;
    Ok(found)
}

/// The figures, with the names of the program's JSON.
fn figures<'py>(py: Python<'py>, metrics: &Metrics) -> PyResult<Bound<'py, PyDict>> {
    let found = PyDict::new(py);
    found.set_item("pixels", metrics.pixels)?;
    found.set_item("density", metrics.density)?;
    for (name, value) in [("avg", metrics.avg), ("rms", metrics.rms), ("psnr", metrics.psnr)] {
        found.set_item(name, value)?;
    }
    for (threshold, share) in evaluation::THRESHOLDS.iter().zip(metrics.bad) {
        found.set_item(format!("bad{threshold:.1}"), share)?;
    }
    for (name, value) in
        [("a50", metrics.a50), ("a90", metrics.a90), ("a95", metrics.a95), ("a99", metrics.a99)]
    {
        found.set_item(name, value)?;
    }
    Ok(found)
}
