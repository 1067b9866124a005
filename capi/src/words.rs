//! Messages of the library with remedies for C users.

use mrfgs::Error;
use mrfgs::check::Warning;
use mrfgs::rectification::Doubt;
use mrfgs::remedy::{self, Vocabulary};

const WORDS: Vocabulary = Vocabulary {
    key: ["option \"", "\""],
    min: "range.min",
    max: "range.max",
    range: Some("range"),
    fork: "make no matcher with a device before the fork",
    cpu: "set mrfgs_options_device(options, \"cpu\")",
    memory: Some(["option \"memory\"", ""]),
    mask: Some("give alpha 0 to everything that is not image"),
    unit: Some("set the right one with mrfgs_calibration_unit()"),
    crop: Some("mrfgs_calibration_crop()"),
    ..Vocabulary::PLAIN
};

/// An error with its remedy.
pub(crate) fn error(error: &Error) -> String {
    remedy::error(error, &WORDS)
}

/// A doubt about a calibration, with its remedy.
pub(crate) fn doubt(doubt: &Doubt) -> String {
    remedy::doubt(doubt, &WORDS)
}

/// A warning with its remedy.
pub(crate) fn warning(warning: &Warning) -> String {
    remedy::warning(warning, &WORDS)
}
