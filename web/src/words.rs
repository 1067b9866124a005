//! Messages of the library, in the terms of the page, or in those of the package for npm.

use mrfgs::Error;
use mrfgs::check::Warning;
use mrfgs::rectification::Doubt;
use mrfgs::remedy::{self, Vocabulary};
use std::cell::Cell;
use wasm_bindgen::JsValue;
use wasm_bindgen::prelude::wasm_bindgen;

use crate::object::object;

const PAGE: Vocabulary = Vocabulary {
    min: "the lower end",
    max: "the upper end",
    range: Some("disparity range"),
    cpu: "use the program in place of the browser",
    driver: ["use one with WebGPU", "update its driver or the browser"],
    unit: Some("choose the right one in the tab Surface"),
    ..Vocabulary::PLAIN
};

const PACKAGE: Vocabulary = Vocabulary {
    preset: "method",
    min: "minDisparity",
    max: "maxDisparity",
    cpu: "use device: 'cpu', or the program mrfgs",
    mask: Some("set alpha to 0 outside the image"),
    range: None,
    ..PAGE
};

thread_local! {
    static WORDS: Cell<&'static Vocabulary> = const { Cell::new(&PAGE) };
}

/// How a pair was rectified.
#[derive(Clone, Copy)]
pub(crate) enum By {
    Calibration,
    Matches,
}

/// Makes messages name the options of the package for npm instead of the fields of the page.
#[wasm_bindgen]
pub fn for_package() {
    WORDS.set(&PACKAGE);
}

/// Converts an error of the library to a JavaScript error.
pub(crate) fn thrown(error: impl Into<Error>) -> js_sys::Error {
    js_sys::Error::new(&self::error(&error.into()))
}

/// The text of an error, with its remedy.
pub(crate) fn error(error: &Error) -> String {
    remedy::error(error, WORDS.get())
}

/// The text of a doubt about a rectification, with its remedy.
pub(crate) fn doubt(doubt: &Doubt) -> String {
    remedy::doubt(doubt, WORDS.get())
}

/// The text of a warning about a pair that is not rectified here, with its remedy.
pub(crate) fn text(warning: &Warning) -> String {
    remedy::warning(warning, WORDS.get())
}

/// A warning about a pair or its maps as `{ text, remedy }`. The text includes a remedy; `remedy` is "swap", "rectify" or "widen" if the
/// page can apply it, or undefined.
pub(crate) fn warning(warning: &Warning, by: Option<&By>) -> JsValue {
    let text = match by {
        Some(by) => remedy::of_rectified(warning, matches!(by, By::Calibration), WORDS.get()),
        None => text(warning),
    };
    let remedy = match warning {
        Warning::Swapped { .. } => Some("swap"),
        Warning::NotRectified { .. } if by.is_none() => Some("rectify"),
        Warning::Clipped { .. } => Some("widen"),
        _ => None,
    };
    object(&[("text", text.into()), ("remedy", remedy.into())])
}
