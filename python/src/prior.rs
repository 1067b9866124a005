//! The arguments of a prior: known disparities of the left view.

use std::sync::Arc;

use mrfgs::Prior;
use mrfgs::image::Plane;
use mrfgs::prior::{PriorKind, PriorPoint};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::arrays;

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
        Prior::points(size, (0..map.height()).map(|i| point(&map, i, single)))
    } else {
        let (rows, columns) = (map.height(), map.width());
        return Err(PyValueError::new_err(format!(
            "prior: give a map of the left image, of shape ({height}, {width}), or points of shape (n, 3) or (n, 4), not ({rows}, {columns})"
        )));
    };
    prior.map(|prior| Some(Arc::new(prior))).map_err(|error| PyValueError::new_err(format!("prior: {error}")))
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

fn kind_of(name: &str) -> PyResult<PriorKind> {
    match name {
        "points" => Ok(PriorKind::Points),
        "surface" => Ok(PriorKind::Surface),
        _ => Err(PyTypeError::new_err(format!("prior_kind: give \"points\" or \"surface\", not \"{name}\""))),
    }
}
