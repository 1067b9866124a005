//! Tracking of rigs whose right camera turns, and correction of their rectification.

use std::ptr;
use std::sync::MutexGuard;

use mrfgs::drift;
use mrfgs::low_level::process::Turns;

use crate::argument;
use crate::frame::{self, Image};
use crate::range::Range;
use crate::rectification::Rectification;
use crate::status::{Failure, Status, call};

/// Measures how the right camera of a rig has turned since its calibration.
pub struct Drift {
    calibrated: mrfgs::rectification::Rectification,
    inner: Turns<drift::Drift>,
}

impl Drift {
    fn inner(&self) -> Result<MutexGuard<'_, drift::Drift>, Failure> {
        Ok(self.inner.turn()?)
    }
}

/// How the right camera of a rig has turned.
#[repr(C)]
#[derive(Default)]
pub struct Turn {
    /// The turn up, right and clockwise since the calibration, in degrees.
    pub degrees: [f64; 3],
    /// Standard errors of the turn, in degrees, as if all frames showed one static scene.
    pub errors: [f64; 3],
    /// The largest shift of rows that it causes, in pixels.
    pub rows: f64,
    /// Number of matches that it is based on; 0 if the frames have too few, and then all other fields are 0.
    pub matches: u32,
    /// 1 if it shifts rows by at least 0.1 px and is significant, else 0.
    pub counts: u32,
}

/// Starts tracking a rig with this rectification, before any turn. The rectification may be freed earlier.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_drift_new(
    rectification: *const Rectification,
    drift: *mut *mut Drift,
) -> Status {
    let make = || {
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let calibrated = unsafe { argument::thing("rectification", rectification) }?.by.clone();
        let inner = Turns::new(drift::Drift::of(&calibrated)?);
        Ok(Drift { calibrated, inner })
    };
    // SAFETY: the caller guarantees that `drift` is null or writable.
    unsafe { argument::make("drift", drift, make) }
}

/// Takes the next frame, rectified by the last result of mrfgs_drift_correct(), or before that by the rectification of the calibration. It
/// evaluates the first, fourth and sixteenth frame, then every 64th, and uses the last 16 of these. The masks belong to the views, as for
/// mrfgs_match_masked(); each may be null. The range contains the disparities of the frame. Calls for one drift take turns.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_drift_follow(
    drift: *const Drift,
    left: *const Image,
    right: *const Image,
    left_mask: *const Image,
    right_mask: *const Image,
    range: *const Range,
) -> Status {
    call(|| {
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let drift = unsafe { argument::thing("drift", drift) }?;
        // SAFETY: the caller guarantees that the images match their fields until this returns.
        let pair = unsafe { frame::pair([left, right], [left_mask, right_mask]) }?;
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let range = unsafe { Range::searched(range) }?;
        let range = range.ok_or_else(|| Failure::argument("the range is null"))?;
        drift.inner()?.follow(&pair, range)?;
        Ok(())
    })
}

/// How the right camera has turned since the calibration, according to the last frames.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_drift_turn(drift: *const Drift, turn: *mut Turn) -> Status {
    call(|| {
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let drift = unsafe { argument::thing("drift", drift) }?;
        if turn.is_null() {
            return Err(Failure::argument("the place for the turn is null"));
        }
        let found = drift.inner()?.turn();
        let told = found.map(|found| Turn {
            degrees: found.degrees(),
            errors: found.errors.map(f64::to_degrees),
            rows: found.rows,
            matches: found.matches as u32,
            counts: found.counts().into(),
        });
        // SAFETY: it is not null, and the caller guarantees the rest.
        unsafe { turn.write(told.unwrap_or_default()) };
        Ok(())
    })
}

/// Makes the rectification for the next frames: that of the calibration with the right camera turned, or null if the last one still holds.
/// Free both, the previous one when nothing uses it any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_drift_correct(
    drift: *const Drift,
    rectification: *mut *mut Rectification,
) -> Status {
    call(|| {
        if rectification.is_null() {
            return Err(Failure::argument("the place for the rectification is null"));
        }
        // SAFETY: it is not null, and the caller guarantees that it is writable.
        unsafe { rectification.write(ptr::null_mut()) };
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let drift = unsafe { argument::thing("drift", drift) }?;
        let corrected = drift.inner()?.correct(&drift.calibrated)?;
        if let Some(by) = corrected {
            let made = Box::new(Rectification::of(by));
            // SAFETY: as above.
            unsafe { rectification.write(Box::into_raw(made)) };
        }
        Ok(())
    })
}

/// Frees a drift; null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_drift_free(drift: *mut Drift) {
    // SAFETY: the caller guarantees that it was made here and is freed once.
    unsafe { argument::free(drift) }
}
