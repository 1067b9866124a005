//! The cameras of a pair, for depth and points.

use std::path::Path;

use mrfgs::Error;
use mrfgs::depth::Rig;
use mrfgs::image::calib::Calibration;

use crate::failure;
use crate::failure::{Failure, Result};
use crate::outputs::also::Also;

/// The cameras that `word` takes, by the `calibration` file of the pair, whose left image is `left` and has `size`.
///
/// # Errors
/// Where there is no such file, or it is of another size or lacks what depth takes; `remedy` says how to give one.
pub(crate) fn rig(
    word: &Also,
    calibration: Option<(&Path, &Calibration)>,
    left: &Path,
    (width, height): (usize, usize),
    remedy: &str,
) -> Result<Rig> {
    let Some((path, calibration)) = calibration else {
        let reason =
            format!("takes the cameras, and there is no calib.txt beside {}; {remedy}", left.display());
        return Err(Failure::Usage(format!("{}: {reason}", word.flag())));
    };
    let size = (calibration.width.unwrap_or(width as u32), calibration.height.unwrap_or(height as u32));
    if size != (width as u32, height as u32) {
        return Err(Error::Mismatch(format!(
            "{} is for images of {} x {} and {} is {width} x {height}: depth takes the calibration of this size",
            path.display(),
            size.0,
            size.1,
            left.display()
        ))
        .into());
    }
    let rig = Rig::new(calibration).map_err(|e| failure::in_file(e, path, ""))?;
    if word.takes_unit() && rig.unit().millimetres().is_none() {
        let reason = format!(
            "{} does not say the unit of the baseline; add an entry `unit` to it: mm, cm or m",
            path.display()
        );
        return Err(Failure::Usage(format!("{}: {reason}", word.flag())));
    }
    Ok(rig)
}
