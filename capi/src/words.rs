//! What the library reports, in the words of C: each cause with the call or the option that helps.

use mrfgs::Error;
use mrfgs::check::Warning;
use mrfgs::remedy::{self, Words};

const WORDS: Words = Words {
    key: ["option \"", "\""],
    min: "range.min",
    max: "range.max",
    range: Some("range"),
    fork: "make no matcher with a device before the fork",
    cpu: "set mrfgs_options_device(options, \"cpu\")",
    memory: Some(["option \"memory\"", ""]),
    mask: Some("give alpha 0 to what is no image"),
    ..Words::PLAIN
};

/// An error with its remedy.
pub(crate) fn error(error: &Error) -> String {
    remedy::error(error, &WORDS)
}

/// A warning with its remedy.
pub(crate) fn warning(warning: &Warning) -> String {
    remedy::warning(warning, &WORDS)
}
