//! What C gives: texts, things that were made before, and places for new ones.

use std::ffi::{CStr, c_char};
use std::ptr;

use crate::status::{Failure, Status, call};

/// The text of the argument `name`.
///
/// # Safety
/// `text` is null or ends with a 0, and stays as it is for `'a`.
pub(crate) unsafe fn text<'a>(name: &str, text: *const c_char) -> Result<&'a str, Failure> {
    if text.is_null() {
        return Err(Failure::argument(format!("{name} is null")));
    }
    // SAFETY: it is not null, and the caller promises the rest.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map_err(|_| Failure::argument(format!("{name} is no UTF-8")))
}

/// The texts of the argument `name`, an array of so many.
///
/// # Safety
/// `texts` is null or holds so many pointers, each as `text` takes it.
pub(crate) unsafe fn texts<'a>(
    name: &str,
    texts: *const *const c_char,
    count: usize,
) -> Result<Vec<&'a str>, Failure> {
    if texts.is_null() {
        return Err(Failure::argument(format!("{name}: the array is null")));
    }
    let each = (0..count).map(|i| {
        // SAFETY: the caller promises that so many are there.
        let one = unsafe { texts.add(i) };
        // SAFETY: the same.
        let one = unsafe { one.read() };
        // SAFETY: the caller promises it.
        unsafe { text(&format!("{name}[{i}]"), one) }
    });
    each.collect()
}

/// What the argument `name` points at.
///
/// # Safety
/// `thing` is null or good for `'a`.
pub(crate) unsafe fn thing<'a, T>(name: &str, thing: *const T) -> Result<&'a T, Failure> {
    // SAFETY: the caller promises it.
    unsafe { thing.as_ref() }.ok_or_else(|| Failure::argument(format!("the {name} is null")))
}

/// Writes width and height to their places.
///
/// # Safety
/// Each place is null, or a number can be written there.
pub(crate) unsafe fn put_size((width, height): (usize, usize), places: [*mut u32; 2]) -> Result<(), Failure> {
    for (place, count, name) in [(places[0], width, "width"), (places[1], height, "height")] {
        if place.is_null() {
            return Err(Failure::argument(format!("the place for the {name} is null")));
        }
        // SAFETY: it is not null, and the caller promises the rest.
        unsafe { place.write(count as u32) };
    }
    Ok(())
}

/// Puts what `make` makes in its place, and null where that fails.
///
/// # Safety
/// `place` is null, or a pointer can be written there.
pub(crate) unsafe fn make<T>(
    name: &str,
    place: *mut *mut T,
    make: impl FnOnce() -> Result<T, Failure>,
) -> Status {
    call(|| {
        if place.is_null() {
            return Err(Failure::argument(format!("the place for the {name} is null")));
        }
        // SAFETY: it is not null, and the caller promises the rest.
        unsafe { place.write(ptr::null_mut()) };
        let made = Box::new(make()?);
        // SAFETY: as above.
        unsafe { place.write(Box::into_raw(made)) };
        Ok(())
    })
}

/// Frees what `make` has made; it may be null.
///
/// # Safety
/// It is of `make`, and freed once.
pub(crate) unsafe fn free<T>(thing: *mut T) {
    if !thing.is_null() {
        call(|| {
            // SAFETY: the caller promises it.
            drop(unsafe { Box::from_raw(thing) });
            Ok(())
        });
    }
}
