//! Texts from C, and for C.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};

use crate::status::Failure;

/// The text of the argument `name`.
///
/// # Safety
/// `text` is null or ends with a 0, and stays as it is for `'a`.
pub(crate) unsafe fn of<'a>(name: &str, text: *const c_char) -> Result<&'a str, Failure> {
    if text.is_null() {
        return Err(Failure::argument(format!("{name} is null")));
    }
    // SAFETY: it is not null, and the caller promises the rest.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map_err(|_| Failure::argument(format!("{name} is no UTF-8")))
}

/// A text that C reads, until the next one is said.
pub(crate) struct Said(RefCell<Option<CString>>);

impl Said {
    pub(crate) const fn nothing() -> Self {
        Self(RefCell::new(None))
    }

    pub(crate) fn say(&self, text: &str) {
        // A 0 would end it.
        let text = CString::new(text.replace('\0', " "));
        *self.0.borrow_mut() = text.ok();
    }

    /// The text, "" where nothing was said.
    pub(crate) fn text(&self) -> *const c_char {
        self.0.borrow().as_deref().unwrap_or(c"").as_ptr()
    }
}
