//! Warnings about probable faults.

use std::ffi::c_char;
use std::ptr;

use mrfgs::check;

use crate::frame::{self, Image};
use crate::range::Range;
use crate::status::{Status, call};
use crate::text::Said;
use crate::words;

thread_local! {
    static LAST: Said = const { Said::nothing() };
}

/// Checks a pair for probable faults (views swapped, turned or not rectified, one far darker), and whether the range clips the scene;
/// without a range (null) only for the former. mrfgs_last_warnings() lists them. It takes a fraction of the time of a match.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_check(left: *const Image, right: *const Image, range: *const Range) -> Status {
    // SAFETY: the caller guarantees all requirements.
    unsafe { mrfgs_check_masked(left, right, ptr::null(), ptr::null(), range) }
}

/// Like mrfgs_check() with masks, as for mrfgs_match_masked().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_check_masked(
    left: *const Image,
    right: *const Image,
    left_mask: *const Image,
    right_mask: *const Image,
    range: *const Range,
) -> Status {
    call(|| {
        // SAFETY: the caller guarantees that the images match their fields until this returns.
        let pair = unsafe { frame::pair([left, right], [left_mask, right_mask]) }?;
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let range = unsafe { Range::searched(range) }?;
        say(check::warnings(&pair, range).iter().map(words::warning));
        Ok(())
    })
}

/// The probable faults found by this thread's last mrfgs_check(), by its last match (many disparities at an end of the range, a prior that
/// the images contradict), or by its last mrfgs_rectification_new() or mrfgs_rig_of_calibration() (a calibration for other images or in
/// another unit), one per line; "" without any. Valid until the next such call that succeeds.
#[unsafe(no_mangle)]
pub extern "C" fn mrfgs_last_warnings() -> *const c_char {
    LAST.with(Said::text)
}

pub(crate) fn say(warnings: impl Iterator<Item = String>) {
    let lines: Vec<_> = warnings.collect();
    LAST.with(|last| last.say(&lines.join("\n")));
}
