//! Maps against the truth.

use std::path::PathBuf;

use mrfgs::evaluation::{self, GroundTruth, Metrics};
use mrfgs::image::read::{Reader, read_disparity as read};
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::exceptions::exception;

/// Reads a disparity map: one of this or of another matcher, or the truth.
///
/// path: a PFM or a TIFF of floats, in pixels; or a PNG of 16 bits as KITTI has it, with disparity times 256 and 0 where there is none.
///     The scale in the header of a PFM does not count, as in Middlebury's files; cv2.imread multiplies by it.
///
/// Returns an array of shape (height, width), float32, in pixels; +inf where there is no disparity. Raises
/// FileNotFoundError where there is no such file, and ValueError where it holds no disparities.
#[pyfunction]
#[pyo3(signature = (path, /))]
pub(crate) fn read_disparity(py: Python, path: PathBuf) -> PyResult<Bound<PyArray2<f32>>> {
    let map = py.detach(|| read(&path)).map_err(exception)?;
    arrays::map(py, map)
}

/// Reads an image as `match` takes it: PNG, JPEG, PNM, TIFF or PFM, as the program reads it.
///
/// path: the file.
/// orient: whether to turn it upright that is stored turned, as the tag of EXIF or TIFF says; a rectified pair is as it is stored.
///
/// Returns an array of shape (height, width), or (height, width, channels) of grey and alpha, RGB, or RGB and alpha: uint8 for up to 8 bits,
/// uint16 for 9 to 16, float32 and float64 for floats, and float64 for wider or signed whole numbers. Where a TIFF file says that a pixel
/// holds no data, it is a masked array. Raises FileNotFoundError where there is no such file, and ValueError where it is no image.
#[pyfunction]
#[pyo3(signature = (path, /, *, orient=false))]
pub(crate) fn read_image(py: Python, path: PathBuf, orient: bool) -> PyResult<Bound<PyAny>> {
    let raster = py.detach(|| Reader { orient, ..Reader::default() }.raster(&path)).map_err(exception)?;
    arrays::stored(py, &raster)
}

/// Compares a disparity map with the truth, as `mrfgs evaluate map` does.
///
/// disparity: array of shape (height, width), float32 or float64, in pixels; what is not finite or masked is invalid. It may be of any
///     matcher.
/// truth: the true disparities, an array of the same kind and shape; what is not finite or masked is unknown and does not count.
/// mask: array of the same shape that says which pixels both views see: bool, or uint8 that is 255 there, as in mask0nocc.png.
///
/// Returns a dict of two dicts. "all" is over every pixel whose truth is known; "nonocc" over those of them that both views see, or None
/// without a mask, or where no such pixel is left. Each holds
///
/// pixels: how many pixels count,
/// density: the share of them that is valid, in percent,
/// avg, rms: mean and root mean square of the error of the valid ones, in pixels,
/// psnr: 10 log10(255^2 / MSE) of the valid ones, in dB,
/// bad0.5, bad1.0, bad2.0, bad4.0: the share of pixels that are wrong by more than so many pixels or invalid, in percent,
/// a50, a90, a95, a99: the error that so many percent of the valid pixels stay below, in pixels.
///
/// A figure that does not exist is None: all errors where no pixel is valid, and the PSNR of a perfect map. Raises ValueError where sizes
/// differ or no truth is known, and TypeError for arrays of other types.
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

/// The figures by the names that they have in the program's JSON.
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
