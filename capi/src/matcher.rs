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
use crate::prior::{self, Prior};
use crate::range::{Range, Region};
use crate::status::{Status, call};
use crate::text::Said;
use crate::warnings;
use crate::words;

/// Matches pairs, keeping the device, its compiled shaders and its buffers in between.
pub struct Matcher {
    inner: SharedMatcher,
    /// The method, without and with the map of the right view.
    methods: [Method; 2],
    stop: AtomicBool,
}

thread_local! {
    static DEVICE: Said = const { Said::nothing() };
    static NOTE: Said = const { Said::nothing() };
}

/// Opens the device, and makes *matcher; options may be null, and may be freed afterwards. On failure *matcher is null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_matcher_new(options: *const Options, matcher: *mut *mut Matcher) -> Status {
    let open = || {
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let options = unsafe { options.as_ref() };
        let (method, execution) = options
            .map_or_else(Default::default, |options| (options.method.clone(), options.execution.clone()));
        let mut with_right = method.clone();
        with_right.set("right-map", "true")?;
        let inner = SharedMatcher::new(mrfgs::Matcher::builder().execution(execution))?;
        let methods = [method, with_right];
        Ok(Matcher { inner, methods, stop: AtomicBool::new(false) })
    };
    // SAFETY: the caller guarantees that `matcher` is null or writable.
    unsafe { argument::make("matcher", matcher, open) }
}

/// Frees a matcher, once no match of it is running; null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_matcher_free(matcher: *mut Matcher) {
    // SAFETY: the caller guarantees that it is from `mrfgs_matcher_new` and is freed once.
    unsafe { argument::free(matcher) }
}

/// Stops the running match, or else the next one, which returns MRFGS_STATUS_STOPPED. Call it from another thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_matcher_stop(matcher: *const Matcher) -> Status {
    call(|| {
        // SAFETY: the caller guarantees that the pointer is null or valid.
        unsafe { argument::thing("matcher", matcher) }?.stop.store(true, Ordering::Relaxed);
        Ok(())
    })
}

/// Matches a rectified pair of images of the same size, and writes maps. Without a range (null) it is estimated from sparse matches.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_match(
    matcher: *const Matcher,
    left: *const Image,
    right: *const Image,
    range: *const Range,
    maps: *const Maps,
) -> Status {
    // SAFETY: the caller guarantees all requirements.
    unsafe { mrfgs_match_masked(matcher, left, right, ptr::null(), ptr::null(), range, maps) }
}

/// Like mrfgs_match() with masks of MRFGS_FORMAT_GREY8 and the size of the images, whose nonzero pixels are ignored. Each may be null.
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
    // SAFETY: the caller guarantees all requirements.
    unsafe { mrfgs_match_region(matcher, left, right, left_mask, right_mask, range, ptr::null(), maps) }
}

/// Like mrfgs_match_masked() for a region of the left image, in proportionally less time; null means all. The maps have the size of the
/// region.
#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments, reason = "C has no default arguments")]
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
    // SAFETY: the caller guarantees all requirements.
    unsafe {
        mrfgs_match_prior(matcher, left, right, left_mask, right_mask, range, region, ptr::null(), maps)
    }
}

/// Like mrfgs_match_region() with what is known of the scene; null means nothing. The prior is of the whole left image.
#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments, reason = "C has no default arguments")]
pub unsafe extern "C" fn mrfgs_match_prior(
    matcher: *const Matcher,
    left: *const Image,
    right: *const Image,
    left_mask: *const Image,
    right_mask: *const Image,
    range: *const Range,
    region: *const Region,
    prior: *const Prior,
    maps: *const Maps,
) -> Status {
    call(|| {
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let matcher = unsafe { argument::thing("matcher", matcher) }?;
        // SAFETY: the caller guarantees that the images match their fields until this returns.
        let pair = unsafe { frame::pair([left, right], [left_mask, right_mask]) }?;
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let range = unsafe { Range::searched(range) }?;
        // SAFETY: as above.
        let part = unsafe { Region::part(region) };
        // SAFETY: as above, and that its points or maps match its fields.
        let known = unsafe { Prior::given(prior, pair.size()) }?;
        // SAFETY: as above.
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
            let job = match known {
                Some(known) => job.prior(known),
                None => job,
            };
            let matched = job.method(method).cancel(&matcher.stop).run();
            // Reset before the turn ends, so that the next match is not stopped.
            matcher.stop.store(false, Ordering::Relaxed);
            matched
        })?;
        // SAFETY: they were checked for this size, and the caller guarantees that they are as large as their fields say.
        unsafe { maps.write(&matched) };
        warnings::say(matched.warnings().iter().map(words::warning));
        prior::say(matched.prior);
        DEVICE.with(|device| device.say(&matched.ran_on));
        NOTE.with(|note| note.say(&matched.note.as_ref().map(words::error).unwrap_or_default()));
        Ok(())
    })
}

/// The device of this thread's last successful match, for display; "" before the first. Valid until the next one.
#[unsafe(no_mangle)]
pub extern "C" fn mrfgs_last_device() -> *const c_char {
    DEVICE.with(Said::text)
}

/// Why that is not the preferred device; "" if it is.
#[unsafe(no_mangle)]
pub extern "C" fn mrfgs_last_note() -> *const c_char {
    NOTE.with(Said::text)
}
