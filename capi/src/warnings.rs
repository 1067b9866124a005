//! What is probably wrong with a pair.

use std::ffi::c_char;

use mrfgs::check::{self, Warning};

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
    call(|| {
        // SAFETY: the caller promises that the images are what their fields say until this returns.
        let pair = unsafe { frame::pair(left, right) }?;
        // SAFETY: the caller promises that the pointer is null or good.
        let range = unsafe { Range::searched(range) }?;
        say(&check::warnings(&pair, range));
        Ok(())
    })
}

/// What the last mrfgs_check() of this thread has found to be probably wrong, or the last mrfgs_match(), which sees whether many
/// disparities are at an end of the range; a line for each, "" where all seems well. It stays until the next one that succeeds.
#[unsafe(no_mangle)]
pub extern "C" fn mrfgs_last_warnings() -> *const c_char {
    LAST.with(Said::text)
}

pub(crate) fn say(warnings: &[Warning]) {
    let lines: Vec<_> = warnings.iter().map(words::warning).collect();
    LAST.with(|last| last.say(&lines.join("\n")));
}
