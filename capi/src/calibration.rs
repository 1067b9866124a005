//! Calibrations of two cameras.

use std::ffi::c_char;
use std::path::{Path, PathBuf};

use mrfgs::calibration::{self, cameras::StereoCalibration};

use crate::argument;
use crate::range::Region;
use crate::status::{Failure, Status, call};

/// The calibration of a pair of cameras.
pub struct Calibration(pub(crate) StereoCalibration);

/// Reads a calibration from one file, or from several that belong together (ROS has one per camera), in any format that `mrfgs match`
/// reads; the format is recognised by content.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_calibration_read(
    paths: *const *const c_char,
    count: usize,
    calibration: *mut *mut Calibration,
) -> Status {
    let read = || {
        // SAFETY: the caller guarantees an array of `count` texts.
        let paths = unsafe { argument::texts("paths", paths, count) }?;
        let paths: Vec<PathBuf> = paths.into_iter().map(PathBuf::from).collect();
        Ok(Calibration(calibration::read(&paths)?))
    };
    // SAFETY: the caller guarantees that `calibration` is null or writable.
    unsafe { argument::make("calibration", calibration, read) }
}

/// Reads a calibration from the texts of such files. Errors call them "texts[0]" and so on.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_calibration_of_texts(
    texts: *const *const c_char,
    count: usize,
    calibration: *mut *mut Calibration,
) -> Status {
    let read = || {
        // SAFETY: the caller guarantees an array of `count` texts.
        let texts = unsafe { argument::texts("texts", texts, count) }?;
        let names: Vec<String> = (0..count).map(|i| format!("texts[{i}]")).collect();
        let files: Vec<_> = names.iter().map(Path::new).zip(texts.into_iter().map(str::to_owned)).collect();
        Ok(Calibration(calibration::of_texts(&files)?))
    };
    // SAFETY: the caller guarantees that `calibration` is null or writable.
    unsafe { argument::make("calibration", calibration, read) }
}

/// Sets the unit of the baseline, if the files lack it or have a wrong one: "mm", "cm" or "m".
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_calibration_unit(
    calibration: *mut Calibration,
    unit: *const c_char,
) -> Status {
    call(|| {
        // SAFETY: the caller guarantees that it is null, or valid and not used elsewhere.
        let calibration = unsafe { calibration.as_mut() };
        let calibration = calibration.ok_or_else(|| Failure::argument("the calibration is null"))?;
        // SAFETY: the caller guarantees a text.
        let unit = unsafe { argument::text("the unit", unit) }?;
        let known = unit.parse();
        calibration.0.set_unit(
            known.map_err(|expected| Failure::argument(format!("the unit is {unit:?}: give {expected}")))?,
        );
        Ok(())
    })
}

/// Crops the calibration, for images that show only a part of the calibrated ones, possibly scaled. Both cameras get the same crop.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_calibration_crop(
    calibration: *mut Calibration,
    part: *const Region,
) -> Status {
    call(|| {
        // SAFETY: the caller guarantees that it is null, or valid and not used elsewhere.
        let calibration = unsafe { calibration.as_mut() };
        let calibration = calibration.ok_or_else(|| Failure::argument("the calibration is null"))?;
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let part = unsafe { Region::part(part) }.ok_or_else(|| Failure::argument("the part is null"))?;
        calibration.0 = calibration.0.of_part(&part)?;
        Ok(())
    })
}

/// Frees a calibration; null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_calibration_free(calibration: *mut Calibration) {
    // SAFETY: the caller guarantees that it was made here and is freed once.
    unsafe { argument::free(calibration) }
}
