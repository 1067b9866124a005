//! Texts for C.

use std::cell::RefCell;
use std::ffi::{CString, c_char};

/// A text for C, valid until the next one.
pub(crate) struct Said(RefCell<Option<CString>>);

impl Said {
    pub(crate) const fn nothing() -> Self {
        Self(RefCell::new(None))
    }

    pub(crate) fn say(&self, text: &str) {
        // A 0 would end the text.
        let text = CString::new(text.replace('\0', " "));
        *self.0.borrow_mut() = text.ok();
    }

    /// The text, "" before the first.
    pub(crate) fn text(&self) -> *const c_char {
        self.0.borrow().as_deref().unwrap_or(c"").as_ptr()
    }
}
