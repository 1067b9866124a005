//! Pairs as the cameras took them.

use std::path::PathBuf;

use mrfgs::Error;
use mrfgs::calibration::cameras::StereoCalibration;
use mrfgs::image::Pair;
use mrfgs::rectification::{Options, Rectification};

use crate::args::rectification::shown;
use crate::failure::{self, Result};

/// Rectifies `pair` by the `calibration` of `files`. Errors name these.
pub(crate) fn rectify(
    calibration: &StereoCalibration,
    files: &[PathBuf],
    pair: &Pair,
    options: &Options,
) -> Result<(Rectification, Pair)> {
    let rectification = Rectification::new(calibration, pair.size(), options).map_err(|e| match e {
        Error::Mismatch(reason) => Error::Mismatch(format!("{}: {reason}", shown(files))),
        e => failure::in_file(e, shown(files).as_ref(), ""),
    })?;
    let pair = rectification.apply(pair)?;
    Ok((rectification, pair))
}
