//! What the library reports, in the words of the page, each cause with the field that helps, or in those of the package for npm.

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
    driver: ["take one that has WebGPU", "update its driver or the browser"],
    unit: Some("choose the right one in the tab Points"),
    ..Vocabulary::PLAIN
};

const PACKAGE: Vocabulary = Vocabulary {
    preset: "method",
    min: "minDisparity",
    max: "maxDisparity",
    cpu: "use device: 'cpu', or the program mrfgs",
    mask: Some("give alpha 0 to what is no image"),
    range: None,
    ..PAGE
};

thread_local! {
    static WORDS: Cell<&'static Vocabulary> = const { Cell::new(&PAGE) };
}

/// What has rectified a pair.
#[derive(Clone, Copy)]
pub(crate) enum By {
    Calibration,
    Matches,
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

/// A doubt about a rectification, with its remedy.
pub(crate) fn doubt(doubt: &Doubt) -> String {
    remedy::doubt(doubt, WORDS.get())
}

/// A warning of `pair` or of its maps as `{ text, remedy }`: with what helps in words, and where the page can do it, as "swap", "rectify"
/// or "widen", or else undefined.
pub(crate) fn warning(warning: &Warning, by: Option<&By>) -> JsValue {
    let text = match by {
        Some(by) => remedy::of_rectified(warning, matches!(by, By::Calibration), WORDS.get()),
        None => remedy::warning(warning, WORDS.get()),
    };
    let remedy = match warning {
        Warning::Swapped { .. } => Some("swap"),
        Warning::NotRectified { .. } if by.is_none() => Some("rectify"),
        Warning::Clipped { .. } => Some("widen"),
        _ => None,
    };
    object(&[("text", text.into()), ("remedy", remedy.into())])
}
