//! The arguments of a prior: known disparities of the left view.

use std::fmt::Display;
use std::sync::Arc;

use mrfgs::Prior;
use mrfgs::image::Plane;
use mrfgs::prior::{PriorKind, PriorPoint};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;

/// The word that stands for the maps of the frame before.
const LAST: &str = "last";
/// The arguments of a prior.
const ARGUMENTS: [&str; 3] = ["prior", "prior_sigma", "prior_kind"];

/// Reads the arguments `prior`, `prior_sigma` and `prior_kind` for a left view of (width, height) pixels.
pub(crate) fn prior(
    size: (usize, usize),
    given: Option<&Bound<PyAny>>,
    sigma: Option<&Bound<PyAny>>,
    kind: Option<&str>,
) -> PyResult<Option<Arc<Prior>>> {
    let Some(given) = given else {
        if sigma.is_some() || kind.is_some() {
            return Err(PyValueError::new_err("prior_sigma, prior_kind: give a prior too"));
        }
        return Ok(None);
    };
    let kind = kind.map(kind_of).transpose()?;
    let map = arrays::disparities("prior", given)?;
    let single = sigma.map(|sigma| sigma.extract::<f64>().ok());
    let sigmas = match (sigma, single) {
        (Some(sigma), Some(None)) => Some(arrays::disparities("prior_sigma", sigma)?),
        _ => None,
    };
    let single = single.flatten();
    let (width, height) = size;
    let prior = if map.size() == size {
        let kind = kind.unwrap_or_else(|| PriorKind::of_map(&map));
        match sigmas {
            Some(sigmas) => Prior::map_with(kind, &map, &sigmas),
            None => Prior::map(kind, &map, single.unwrap_or(kind.usual_sigma())),
        }
    } else if [3, 4].contains(&map.width()) && sigmas.is_none() && kind != Some(PriorKind::Surface) {
        let known = |row: &usize| map.row(*row)[..3].iter().all(|value| value.is_finite());
        let rows: Vec<usize> = (0..map.height()).filter(known).collect();
        if rows.is_empty() && map.height() > 0 {
            let reason = format!("prior: none of the {} points has an x, y and disparity", map.height());
            return Err(PyValueError::new_err(reason));
        }
        Prior::points(size, rows.into_iter().map(|row| point(&map, row, single)))
    } else {
        let (rows, columns) = (map.height(), map.width());
        return Err(PyValueError::new_err(format!(
            "prior: give a map of the left image, of shape ({height}, {width}), or points of shape (n, 3) or (n, 4), not ({rows}, {columns})"
        )));
    };
    prior.map(|prior| Some(Arc::new(prior))).map_err(|error| PyValueError::new_err(format!("prior: {error}")))
}

/// Reads the argument `prior` of a sequence: whether each frame follows from the one before.
pub(crate) fn follows(given: Option<&Bound<PyAny>>) -> PyResult<bool> {
    let Some(given) = given else { return Ok(false) };
    if given.extract::<String>().is_ok_and(|word| word == LAST) {
        return Ok(true);
    }
    Err(PyTypeError::new_err(format!(
        "prior: give \"{LAST}\", for the maps of the frame before, or a prior with each pair: (left, right, prior)"
    )))
}

/// Reads the prior of a pair of a sequence, the third beside its views: an array, or a dict of the arguments of `match` for it.
pub(crate) fn of_pair(size: (usize, usize), given: &Bound<PyAny>) -> PyResult<Option<Arc<Prior>>> {
    if given.is_none() {
        return Ok(None);
    }
    let Ok(arguments) = given.cast::<PyDict>() else { return prior(size, Some(given), None, None) };
    for key in arguments.keys() {
        if !key.extract::<String>().is_ok_and(|key| ARGUMENTS.contains(&&*key)) {
            let reason = format!("prior: {} is none of {}", key.repr()?, ARGUMENTS.join(", "));
            return Err(PyTypeError::new_err(reason));
        }
    }
    let argument =
        |i: usize| Ok::<_, PyErr>(arguments.get_item(ARGUMENTS[i])?.filter(|value| !value.is_none()));
    let [given, sigma, kind] = [argument(0)?, argument(1)?, argument(2)?];
    let kind = kind.map(|kind| kind.extract::<String>().map_err(|_| no_kind(&kind))).transpose()?;
    prior(size, given.as_ref(), sigma.as_ref(), kind.as_deref())
}

/// Row `i` of an array of points: x, y, disparity, and perhaps sigma.
fn point(points: &Plane<f32>, i: usize, sigma: Option<f64>) -> PriorPoint {
    let row = points.row(i);
    let usual = || row.get(3).map_or(PriorKind::Points.usual_sigma(), |&sigma| sigma.into());
    PriorPoint {
        x: row[0].into(),
        y: row[1].into(),
        disparity: row[2].into(),
        sigma: sigma.unwrap_or_else(usual),
    }
}

fn no_kind(given: impl Display) -> PyErr {
    PyTypeError::new_err(format!("prior_kind: give \"points\" or \"surface\", not \"{given}\""))
}

fn kind_of(name: &str) -> PyResult<PriorKind> {
    match name {
        "points" => Ok(PriorKind::Points),
        "surface" => Ok(PriorKind::Surface),
        _ => Err(no_kind(name)),
    }
}
