//! The disparity range.

use mrfgs::image::Pair;
use mrfgs::options::{DisparityRange, MAX_DISPARITY};
use mrfgs::{SharedMatcher, check};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::exceptions::{self, exception};

/// Converts the disparity argument `name`: a whole number of pixels, of any numeric type.
pub(crate) fn pixels(name: &str, given: Option<&Bound<PyAny>>) -> PyResult<Option<i32>> {
    let Some(given) = given else { return Ok(None) };
    let expected = format!("{name}: give a whole number of pixels within {MAX_DISPARITY} of 0");
    let kind = given.get_type().name()?;
    let wrong = |error| {
        let reason = PyTypeError::new_err(format!("{expected}, not {kind}"));
        exceptions::instead(given.py(), error, reason)
    };
    let number: f64 = given.extract().map_err(wrong)?;
    // False for NaN and infinities, too.
    if number.trunc() == number && number.abs() <= f64::from(MAX_DISPARITY) {
        Ok(Some(number as i32))
    } else {
        Err(PyValueError::new_err(format!("{expected}, not {number}")))
    }
}

/// The range, if `max` is given.
pub(crate) fn given(max: Option<i32>, min: Option<i32>) -> PyResult<Option<DisparityRange>> {
    max.map(|max| DisparityRange::new(min.unwrap_or(0), max)).transpose().map_err(exception)
}

/// The range to search: the given one, or one estimated from sparse matches.
pub(crate) fn searched(
    py: Python,
    matcher: &SharedMatcher,
    pair: &Pair,
    given: Option<DisparityRange>,
    min: Option<i32>,
) -> PyResult<DisparityRange> {
    given.map_or_else(|| py.detach(|| found(matcher, pair, min)), Ok)
}

/// The range estimated from sparse matches, starting at `min` if given.
fn found(matcher: &SharedMatcher, pair: &Pair, min: Option<i32>) -> PyResult<DisparityRange> {
    let found = matcher.share(pair, || check::range(pair)).and_then(|found| found).map_err(exception)?;
    DisparityRange::new(min.unwrap_or(found.min), found.max).map_err(exception)
}
