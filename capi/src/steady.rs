//! Temporal smoothing of video.

use std::ptr;

use mrfgs::low_level::process::Turns;
use mrfgs::maps;
use mrfgs::steady;

use crate::argument;
use crate::frame::{self, Image};
use crate::maps::{Maps, put, read};
use crate::status::{Failure, Status, call};

/// A filter for the maps of a sequence that steadies still surfaces by averaging with earlier frames.
pub struct Steady(Turns<steady::Steady>);

/// Makes a filter without frames.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_steady_new(steady: *mut *mut Steady) -> Status {
    // SAFETY: the caller guarantees that `steady` is null or writable.
    unsafe { argument::make("steady", steady, || Ok(Steady(Turns::default()))) }
}

/// Smooths the disparities of the next frame: where the left image has not changed, they are averaged with earlier frames, weighted by
/// confidence. `left` is the image that was matched, and `maps` are the results: disparity, which is changed, and confidence and validity,
/// which are read. Another image size starts a new sequence. Calls for one filter take turns. For 8-bit images the maps equal those of
/// `mrfgs sequence --steady`; deeper ones are scaled by their own values, unlike in the program, which uses both views.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_steady_follow(
    steady: *const Steady,
    left: *const Image,
    maps: *const Maps,
) -> Status {
    call(|| {
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let steady = unsafe { argument::thing("steady", steady) }?;
        // SAFETY: the caller guarantees that the image matches its fields until this returns.
        let pair = unsafe { frame::pair([left, left], [ptr::null(); 2]) }?;
        // SAFETY: the caller guarantees that the pointer is null or valid.
        let given = unsafe { Maps::given(maps) }?;
        let size = pair.size();
        given.check(size)?;
        let needed = [
            ("disparity", given.disparity.is_null()),
            ("confidence", given.confidence.is_null()),
            ("validity", given.validity.is_null()),
        ];
        if let Some((name, _)) = needed.into_iter().find(|(_, is_null)| *is_null) {
            return Err(Failure::argument(format!("the map maps.{name} is null: the filter needs it")));
        }
        // SAFETY: it was checked, and the caller guarantees that it is as large as its fields say.
        let disparity = unsafe { read(given.disparity.cast_const(), given.disparity_stride, size) };
        // SAFETY: as above.
        let confidence = unsafe { read(given.confidence.cast_const(), given.confidence_stride, size) };
        // SAFETY: as above.
        let validity = unsafe { read(given.validity.cast_const(), given.validity_stride, size) };
        let mut found = maps::Maps::from_pixels(&disparity, confidence, validity);
        steady.0.turn()?.follow(pair.left(), &mut found);
        // SAFETY: as above.
        unsafe { put(&found.final_map(), given.disparity, given.disparity_stride) };
        Ok(())
    })
}

/// Frees a filter; null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_steady_free(steady: *mut Steady) {
    // SAFETY: the caller guarantees that it was made here and is freed once.
    unsafe { argument::free(steady) }
}
