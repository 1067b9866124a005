//! What is probably wrong with a pair.

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

/// Looks for what is probably wrong with a pair (views swapped, turned or not rectified, one of them far darker), and for a range that
/// cuts off a part of the scene; without a range (null) only for the former. mrfgs_last_warnings() says what it has found. It takes a
/// part of the time of a match.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_check(left: *const Image, right: *const Image, range: *const Range) -> Status {
    // SAFETY: the caller promises what is needed.
    unsafe { mrfgs_check_masked(left, right, ptr::null(), ptr::null(), range) }
}

/// The same with masks, as mrfgs_match_masked() takes them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_check_masked(
    left: *const Image,
    right: *const Image,
    left_mask: *const Image,
    right_mask: *const Image,
    range: *const Range,
) -> Status {
    call(|| {
        // SAFETY: the caller promises that the images are what their fields say until this returns.
        let pair = unsafe { frame::pair([left, right], [left_mask, right_mask]) }?;
        // SAFETY: the caller promises that the pointer is null or good.
        let range = unsafe { Range::searched(range) }?;
        say(check::warnings(&pair, range).iter().map(words::warning));
        Ok(())
    })
}

/// What the last mrfgs_check() of this thread has found to be probably wrong, or the last mrfgs_match(), which sees whether many
/// disparities are at an end of the range, or the last mrfgs_rectification_new() or mrfgs_rig_of_calibration(), which see whether the
/// calibration is of other images or in another unit; a line for each, "" where all seems well. It stays until the next one that succeeds.
#[unsafe(no_mangle)]
pub extern "C" fn mrfgs_last_warnings() -> *const c_char {
    LAST.with(Said::text)
}

pub(crate) fn say(warnings: impl Iterator<Item = String>) {
    let lines: Vec<_> = warnings.collect();
    LAST.with(|last| last.say(&lines.join("\n")));
}
