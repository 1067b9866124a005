//! Rigs that drift, and how they are put right.

use std::ptr;
use std::sync::MutexGuard;

use mrfgs::drift;
use mrfgs::low_level::process::Turns;

use crate::argument;
use crate::frame::{self, Image};
use crate::range::Range;
use crate::rectification::Rectification;
use crate::status::{Failure, Status, call};

/// What the frames of a rig show of how its right camera has turned since it was calibrated.
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
    /// How far it looks up, to the right and clockwise, in degrees, from where it was calibrated.
    pub degrees: [f64; 3],
    /// The standard errors of these, in degrees, as if all frames showed one still scene.
    pub errors: [f64; 3],
    /// How far that moves rows apart at most, in pixels.
    pub rows: f64,
    /// How many matches show it: 0 where the frames have too few, and all the rest is 0 then.
    pub matches: u32,
    /// 1 where it moves rows by 0.1 px or more and is no chance, else 0.
    pub counts: u32,
}

/// The drift of a rig with this rectification, from which nothing has turned yet. The rectification may be freed before it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_drift_new(
    rectification: *const Rectification,
    drift: *mut *mut Drift,
) -> Status {
    let make = || {
        // SAFETY: the caller promises that the pointer is null or good.
        let calibrated = unsafe { argument::thing("rectification", rectification) }?.by.clone();
        let inner = Turns::new(drift::Drift::of(&calibrated)?);
        Ok(Drift { calibrated, inner })
    };
    // SAFETY: the caller promises that a pointer can be written there.
    unsafe { argument::make("drift", drift, make) }
}

/// Takes the next frame, rectified by what mrfgs_drift_correct() gave last, and before that by the rectification of the calibration. It
/// looks at the first, the fourth, the sixteenth, and then at every 64th, and of these the last 16 count. The masks are those of the views,
/// as mrfgs_match_masked() takes them; each may be null. The range holds the disparities of the frame. Calls for one drift take turns.
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
        // SAFETY: the caller promises that the pointer is null or good.
        let drift = unsafe { argument::thing("drift", drift) }?;
        // SAFETY: the caller promises that the images are what their fields say until this returns.
        let pair = unsafe { frame::pair([left, right], [left_mask, right_mask]) }?;
        // SAFETY: the caller promises that the pointer is null or good.
        let range = unsafe { Range::searched(range) }?;
        let range = range.ok_or_else(|| Failure::argument("the range is null"))?;
        drift.inner()?.follow(&pair, range)?;
        Ok(())
    })
}

/// How the right camera has turned since the calibration, as far as the last frames show it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_drift_turn(drift: *const Drift, turn: *mut Turn) -> Status {
    call(|| {
        // SAFETY: the caller promises that the pointer is null or good.
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
        // SAFETY: it is not null, and the caller promises the rest.
        unsafe { turn.write(told.unwrap_or_default()) };
        Ok(())
    })
}

/// Makes the rectification of the next frames: that of the calibration, with the right camera turned. It is null where what rectified the
/// last ones is still right. Free both, the one before when nothing uses it any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_drift_correct(
    drift: *const Drift,
    rectification: *mut *mut Rectification,
) -> Status {
    call(|| {
        if rectification.is_null() {
            return Err(Failure::argument("the place for the rectification is null"));
        }
        // SAFETY: it is not null, and the caller promises that a pointer can be written there.
        unsafe { rectification.write(ptr::null_mut()) };
        // SAFETY: the caller promises that the pointer is null or good.
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

/// Frees a drift; it may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_drift_free(drift: *mut Drift) {
    // SAFETY: the caller promises that it was made here, and is freed once.
    unsafe { argument::free(drift) }
}
