//! What the library reports, in the words of the page: each cause with the field that helps.

use mrfgs::Error;
use mrfgs::check::Warning;
use mrfgs::remedy::{self, Words};

const WORDS: Words = Words {
    min: "the lower end",
    max: "the upper end",
    range: Some("disparity range"),
    cpu: "use the program in place of the browser",
    driver: ["take one that has WebGPU", "update its driver or the browser"],
    ..Words::PLAIN
};

/// What is thrown for an error of the library.
pub(crate) fn thrown(error: impl Into<Error>) -> js_sys::Error {
    js_sys::Error::new(&self::error(&error.into()))
}

/// An error with its remedy.
pub(crate) fn error(error: &Error) -> String {
    remedy::error(error, &WORDS)
}

/// A warning with its remedy.
pub(crate) fn warning(warning: &Warning) -> String {
    remedy::warning(warning, &WORDS)
}
