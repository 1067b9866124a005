//! Video that holds still where the scene does.

use std::ptr;

use mrfgs::low_level::process::Turns;
use mrfgs::maps;
use mrfgs::steady;

use crate::argument;
use crate::frame::{self, Image};
use crate::maps::{Maps, put, read};
use crate::status::{Failure, Status, call};

/// A filter for the maps of a sequence: where the left image does not change, the disparity follows that of the frames before.
pub struct Steady(Turns<steady::Steady>);

/// A filter that has seen no frame yet.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_steady_new(steady: *mut *mut Steady) -> Status {
    // SAFETY: the caller promises that a pointer can be written there.
    unsafe { argument::make("steady", steady, || Ok(Steady(Turns::default()))) }
}

/// Lets the disparities of the next frame follow those of the frames before, weighted by confidence, where the left image has not changed.
/// `left` is the image that was matched, and `maps` are what the match has written: disparity, confidence and validity, of which the
/// disparity is changed and the others are read. A frame of another size begins a new sequence. Calls for one filter take turns.
/// For images of 8 bits these are the maps of `mrfgs sequence --steady`; deeper ones are scaled by their own values, where the program
/// looks at both views.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_steady_follow(
    steady: *const Steady,
    left: *const Image,
    maps: *const Maps,
) -> Status {
    call(|| {
        // SAFETY: the caller promises that the pointer is null or good.
        let steady = unsafe { argument::thing("steady", steady) }?;
        // SAFETY: the caller promises that the image is what its fields say until this returns.
        let pair = unsafe { frame::pair([left, left], [ptr::null(); 2]) }?;
        // SAFETY: the caller promises that the pointer is null or good.
        let given = unsafe { Maps::given(maps) }?;
        let size = pair.size();
        given.check(size)?;
        let needed = [
            ("disparity", given.disparity.is_null()),
            ("confidence", given.confidence.is_null()),
            ("validity", given.validity.is_null()),
        ];
        if let Some((name, _)) = needed.into_iter().find(|(_, is_null)| *is_null) {
            return Err(Failure::argument(format!("the map maps.{name} is null: the filter takes it")));
        }
        // SAFETY: it was checked, and the caller promises that it is as large as its fields say.
        let disparity = unsafe { read(given.disparity.cast_const(), given.disparity_stride, size) };
        // SAFETY: the same.
        let confidence = unsafe { read(given.confidence.cast_const(), given.confidence_stride, size) };
        // SAFETY: the same.
        let validity = unsafe { read(given.validity.cast_const(), given.validity_stride, size) };
        let mut found = maps::Maps::from_pixels(&disparity, confidence, validity);
        steady.0.turn()?.follow(pair.left(), &mut found);
        // SAFETY: the same.
        unsafe { put(&found.final_map(), given.disparity, given.disparity_stride) };
        Ok(())
    })
}

/// Frees a filter; it may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_steady_free(steady: *mut Steady) {
    // SAFETY: the caller promises that it was made here, and is freed once.
    unsafe { argument::free(steady) }
}
