//! What the library reports, in the words of the page, each cause with the field that helps, or in those of the package for npm.

use mrfgs::Error;
use mrfgs::check::Warning;
use mrfgs::remedy::{self, Words};
use std::cell::Cell;
use wasm_bindgen::prelude::wasm_bindgen;

const PAGE: Words = Words {
    min: "the lower end",
    max: "the upper end",
    range: Some("disparity range"),
    cpu: "use the program in place of the browser",
    driver: ["take one that has WebGPU", "update its driver or the browser"],
    ..Words::PLAIN
};

const PACKAGE: Words = Words {
    preset: "method",
    min: "minDisparity",
    max: "maxDisparity",
    cpu: "use device: 'cpu', or the program mrfgs",
    mask: Some("give alpha 0 to what is no image"),
    range: None,
    ..PAGE
};

thread_local! {
    static WORDS: Cell<&'static Words> = const { Cell::new(&PAGE) };
}

/// From now on names what the package for npm takes, and not the fields of the page.
#[wasm_bindgen]
pub fn for_package() {
    WORDS.set(&PACKAGE);
}

/// What is thrown for an error of the library.
pub(crate) fn thrown(error: impl Into<Error>) -> js_sys::Error {
    js_sys::Error::new(&self::error(&error.into()))
}

/// An error with its remedy.
pub(crate) fn error(error: &Error) -> String {
    remedy::error(error, WORDS.get())
}

/// A warning with its remedy.
pub(crate) fn warning(warning: &Warning) -> String {
    remedy::warning(warning, WORDS.get())
}
