//! The matcher.

use std::ffi::c_char;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use crate::frame::{self, Image};
use crate::maps::Maps;
use crate::options::Options;
use crate::range::Range;
use crate::status::{Failure, Status, call};
use crate::text::Said;
use crate::warnings;
use crate::words;

/// Matches pair after pair, and keeps the device, its compiled shaders and its buffers in between.
pub struct Matcher {
    matcher: Mutex<mrfgs::Matcher>,
    stop: AtomicBool,
}

thread_local! {
    static DEVICE: Said = const { Said::nothing() };
    static NOTE: Said = const { Said::nothing() };
}

/// Opens the device, and makes *matcher; options may be null, and are not needed afterwards. Where it fails, *matcher is null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_matcher_new(options: *const Options, matcher: *mut *mut Matcher) -> Status {
    call(|| {
        if matcher.is_null() {
            return Err(Failure::argument("the place for the matcher is null"));
        }
        // SAFETY: it is not null, and the caller promises that a pointer can be written there.
        unsafe { matcher.write(std::ptr::null_mut()) };
        let mut builder = mrfgs::Matcher::builder();
        // SAFETY: the caller promises that the pointer is null or good.
        if let Some(options) = unsafe { options.as_ref() } {
            builder = builder.method(options.method.clone()).execution(options.execution.clone());
        }
        let made = Box::new(Matcher { matcher: Mutex::new(builder.build()?), stop: AtomicBool::new(false) });
        // SAFETY: as above.
        unsafe { matcher.write(Box::into_raw(made)) };
        Ok(())
    })
}

/// Frees a matcher, when no match of it runs any more; it may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_matcher_free(matcher: *mut Matcher) {
    if !matcher.is_null() {
        call(|| {
            // SAFETY: the caller promises that it is of `mrfgs_matcher_new`, and freed once.
            drop(unsafe { Box::from_raw(matcher) });
            Ok(())
        });
    }
}

/// Ends the match that runs, from another thread, or else the next one: it returns MRFGS_STATUS_STOPPED.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_matcher_stop(matcher: *const Matcher) -> Status {
    call(|| {
        // SAFETY: the caller promises that the pointer is null or good.
        let matcher = unsafe { matcher.as_ref() };
        matcher.ok_or_else(|| Failure::argument("the matcher is null"))?.stop.store(true, Ordering::Relaxed);
        Ok(())
    })
}

/// Matches a rectified pair of images of one size, and writes maps. Without a range (null), sparse matches find it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_match(
    matcher: *const Matcher,
    left: *const Image,
    right: *const Image,
    range: *const Range,
    maps: *const Maps,
) -> Status {
    call(|| {
        // SAFETY: the caller promises that the pointer is null or good.
        let matcher = unsafe { matcher.as_ref() }.ok_or_else(|| Failure::argument("the matcher is null"))?;
        // SAFETY: the caller promises that the images are what their fields say until this returns.
        let pair = unsafe { frame::pair(left, right) }?;
        // SAFETY: the caller promises that the pointer is null or good.
        let range = unsafe { Range::searched(range) }?;
        // SAFETY: the same.
        let maps =
            unsafe { maps.as_ref() }.ok_or_else(|| Failure::argument("the structure of the maps is null"))?;
        maps.check(pair.size())?;
        let mut matching = matcher.matcher.lock().unwrap_or_else(PoisonError::into_inner);
        let job = match range {
            Some(range) => matching.job(&pair, range),
            None => matching.job(&pair, ..),
        };
        let matched = job.cancel(&matcher.stop).run();
        // While the lock is held: the next match is not meant any more.
        matcher.stop.store(false, Ordering::Relaxed);
        drop(matching);
        let matched = matched?;
        // SAFETY: they were checked for this size, and the caller promises that they are as large as their fields say.
        unsafe { maps.write(&matched) };
        warnings::say(&matched.warnings());
        DEVICE.with(|device| device.say(&matched.ran_on));
        NOTE.with(|note| note.say(&matched.note.as_ref().map(words::error).unwrap_or_default()));
        Ok(())
    })
}

/// What ran the last match of this thread that succeeded, for people; "" before the first. It stays until the next one.
#[unsafe(no_mangle)]
pub extern "C" fn mrfgs_last_device() -> *const c_char {
    DEVICE.with(Said::text)
}

/// Why that is not the device that was hoped for; "" where it is.
#[unsafe(no_mangle)]
pub extern "C" fn mrfgs_last_note() -> *const c_char {
    NOTE.with(Said::text)
}
