//! The matcher.

use std::ffi::c_char;
use std::ptr;
use std::sync::atomic::{AtomicBool, Ordering};

use mrfgs::SharedMatcher;
use mrfgs::image::Rect;
use mrfgs::options::Method;

use crate::argument;
use crate::frame::{self, Image};
use crate::maps::Maps;
use crate::options::Options;
use crate::range::{Range, Region};
use crate::status::{Status, call};
use crate::text::Said;
use crate::warnings;
use crate::words;

/// Matches pair after pair, and keeps the device, its compiled shaders and its buffers in between.
pub struct Matcher {
    inner: SharedMatcher,
    /// Its method, and the same with the map of the right view.
    methods: [Method; 2],
    stop: AtomicBool,
}

thread_local! {
    static DEVICE: Said = const { Said::nothing() };
    static NOTE: Said = const { Said::nothing() };
}

/// Opens the device, and makes *matcher; options may be null, and are not needed afterwards. Where it fails, *matcher is null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_matcher_new(options: *const Options, matcher: *mut *mut Matcher) -> Status {
    let open = || {
        // SAFETY: the caller promises that the pointer is null or good.
        let options = unsafe { options.as_ref() };
        let (method, execution) = options
            .map_or_else(Default::default, |options| (options.method.clone(), options.execution.clone()));
        let mut with_right = method.clone();
        with_right.set("right-map", "true")?;
        let inner = SharedMatcher::new(mrfgs::Matcher::builder().execution(execution))?;
        let methods = [method, with_right];
        Ok(Matcher { inner, methods, stop: AtomicBool::new(false) })
    };
    // SAFETY: the caller promises that a pointer can be written there.
    unsafe { argument::make("matcher", matcher, open) }
}

/// Frees a matcher, when no match of it runs any more; it may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_matcher_free(matcher: *mut Matcher) {
    // SAFETY: the caller promises that it is of `mrfgs_matcher_new`, and freed once.
    unsafe { argument::free(matcher) }
}

/// Ends the match that runs, from another thread, or else the next one: it returns MRFGS_STATUS_STOPPED.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_matcher_stop(matcher: *const Matcher) -> Status {
    call(|| {
        // SAFETY: the caller promises that the pointer is null or good.
        unsafe { argument::thing("matcher", matcher) }?.stop.store(true, Ordering::Relaxed);
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
    // SAFETY: the caller promises what is needed.
    unsafe { mrfgs_match_masked(matcher, left, right, ptr::null(), ptr::null(), range, maps) }
}

/// The same with masks, MRFGS_FORMAT_GREY8 and of the size of the images: where one is not 0, the pixel of its image is ignored. Each
/// may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_match_masked(
    matcher: *const Matcher,
    left: *const Image,
    right: *const Image,
    left_mask: *const Image,
    right_mask: *const Image,
    range: *const Range,
    maps: *const Maps,
) -> Status {
    // SAFETY: the caller promises what is needed.
    unsafe { mrfgs_match_region(matcher, left, right, left_mask, right_mask, range, ptr::null(), maps) }
}

/// The same of a region of the left image alone, in the time of that part; null takes all. The maps have the size of the region.
#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments, reason = "C has no other way to leave some out")]
pub unsafe extern "C" fn mrfgs_match_region(
    matcher: *const Matcher,
    left: *const Image,
    right: *const Image,
    left_mask: *const Image,
    right_mask: *const Image,
    range: *const Range,
    region: *const Region,
    maps: *const Maps,
) -> Status {
    call(|| {
        // SAFETY: the caller promises that the pointer is null or good.
        let matcher = unsafe { argument::thing("matcher", matcher) }?;
        // SAFETY: the caller promises that the images are what their fields say until this returns.
        let pair = unsafe { frame::pair([left, right], [left_mask, right_mask]) }?;
        // SAFETY: the caller promises that the pointer is null or good.
        let range = unsafe { Range::searched(range) }?;
        // SAFETY: the same.
        let part = unsafe { Region::part(region) };
        // SAFETY: the same.
        let maps = unsafe { Maps::given(maps) }?;
        maps.check(part.as_ref().map_or(pair.size(), Rect::size))?;
        let method = &matcher.methods[usize::from(!maps.right.is_null())];
        let matched = matcher.inner.turn(|matching| {
            let job = match range {
                Some(range) => matching.job(&pair, range),
                None => matching.job(&pair, ..),
            };
            let job = match part {
                Some(part) => job.region(part),
                None => job,
            };
            let matched = job.method(method).cancel(&matcher.stop).run();
            // Before the turn ends: the next match is not meant any more.
            matcher.stop.store(false, Ordering::Relaxed);
            matched
        })?;
        // SAFETY: they were checked for this size, and the caller promises that they are as large as their fields say.
        unsafe { maps.write(&matched) };
        warnings::say(matched.warnings().iter().map(words::warning));
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
