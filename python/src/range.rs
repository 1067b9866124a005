//! The disparities to search.

use mrfgs::check;
use mrfgs::error::RangeError;
use mrfgs::image::Pair;
use mrfgs::options::DisparityRange;
use pyo3::prelude::*;

use crate::exceptions::exception;

/// The range that is given.
pub(crate) fn given(max: Option<i32>, min: Option<i32>) -> PyResult<Option<DisparityRange>> {
    max.map(|max| DisparityRange::new(min.unwrap_or(0), max)).transpose().map_err(exception)
}

/// The range to search: the one that is given, or that of sparse matches.
pub(crate) fn searched(
    py: Python,
    pair: &Pair,
    given: Option<DisparityRange>,
    min: Option<i32>,
) -> PyResult<DisparityRange> {
    given.map_or_else(|| py.detach(|| found(pair, min)), Ok)
}

/// The range that sparse matches find, from `min` on where that is given.
fn found(pair: &Pair, min: Option<i32>) -> PyResult<DisparityRange> {
    let Some(found) = check::range(pair).map_err(exception)? else {
        return Err(exception(RangeError::NotFound.into()));
    };
    DisparityRange::new(min.unwrap_or(found.min), found.max).map_err(exception)
}
