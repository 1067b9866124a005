//! Arguments from C: texts, objects made earlier, and places for new ones.

use std::ffi::{CStr, c_char};
use std::ptr;

use crate::status::{Failure, Status, call};

/// Reads the text of the argument `name`.
///
/// # Safety
/// `text` is null or ends with a 0, and does not change for `'a`.
pub(crate) unsafe fn text<'a>(name: &str, text: *const c_char) -> Result<&'a str, Failure> {
    if text.is_null() {
        return Err(Failure::argument(format!("{name} is null")));
    }
    // SAFETY: it is not null, and the caller guarantees the rest.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map_err(|_| Failure::argument(format!("{name} is not UTF-8")))
}

/// Reads the texts of the argument `name`, an array of `count` texts.
///
/// # Safety
/// `texts` is null or holds `count` pointers, each valid for `text`.
pub(crate) unsafe fn texts<'a>(
    name: &str,
    texts: *const *const c_char,
    count: usize,
) -> Result<Vec<&'a str>, Failure> {
    if texts.is_null() {
        return Err(Failure::argument(format!("{name}: the array is null")));
    }
    let each = (0..count).map(|i| {
        // SAFETY: the caller guarantees that the array has this many elements.
        let one = unsafe { texts.add(i) };
        // SAFETY: as above.
        let one = unsafe { one.read() };
        // SAFETY: guaranteed by the caller.
        unsafe { text(&format!("{name}[{i}]"), one) }
    });
    each.collect()
}

/// Dereferences the argument `name`.
///
/// # Safety
/// `thing` is null or valid for `'a`.
pub(crate) unsafe fn thing<'a, T>(name: &str, thing: *const T) -> Result<&'a T, Failure> {
    // SAFETY: guaranteed by the caller.
    unsafe { thing.as_ref() }.ok_or_else(|| Failure::argument(format!("the {name} is null")))
}

/// The refusal of a structure whose field for its own size is not `size_of::<T>()`; `said` says what it is.
pub(crate) fn wrong_size<T>(said: &str, name: &str) -> Failure {
    Failure::argument(format!(
        "{said}, but sizeof({name}) is {} in the library: set it, and build with the library's own header",
        size_of::<T>()
    ))
}

/// Writes width and height to the given places.
///
/// # Safety
/// Each place is null or writable.
pub(crate) unsafe fn put_size((width, height): (usize, usize), places: [*mut u32; 2]) -> Result<(), Failure> {
    for (place, count, name) in [(places[0], width, "width"), (places[1], height, "height")] {
        if place.is_null() {
            return Err(Failure::argument(format!("the place for the {name} is null")));
        }
        // SAFETY: it is not null, and the caller guarantees the rest.
        unsafe { place.write(count as u32) };
    }
    Ok(())
}

/// Stores the result of `make` in `place`, or null if that fails.
///
/// # Safety
/// `place` is null or writable.
pub(crate) unsafe fn make<T>(
    name: &str,
    place: *mut *mut T,
    make: impl FnOnce() -> Result<T, Failure>,
) -> Status {
    call(|| {
        if place.is_null() {
            return Err(Failure::argument(format!("the place for the {name} is null")));
        }
        // SAFETY: it is not null, and the caller guarantees the rest.
        unsafe { place.write(ptr::null_mut()) };
        let made = Box::new(make()?);
        // SAFETY: as above.
        unsafe { place.write(Box::into_raw(made)) };
        Ok(())
    })
}

/// Frees an object made by `make`; null is allowed.
///
/// # Safety
/// It comes from `make` and is freed once.
pub(crate) unsafe fn free<T>(thing: *mut T) {
    if !thing.is_null() {
        call(|| {
            // SAFETY: guaranteed by the caller.
            drop(unsafe { Box::from_raw(thing) });
            Ok(())
        });
    }
}
