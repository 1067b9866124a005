//! What the library reports, in the words of Python: each cause with the argument or the option that helps.

use mrfgs::Error;
use mrfgs::check::Warning;
use mrfgs::rectification::Doubt;
use mrfgs::remedy::{self, Vocabulary};

const WORDS: Vocabulary = Vocabulary {
    key: ["options[\"", "\"]"],
    min: "min_disparity",
    max: "max_disparity",
    cpu: "use device=\"cpu\"",
    fork: "start it by multiprocessing.get_context(\"spawn\") or \"forkserver\", or make no Matcher with a device before the fork",
    memory: Some(["memory", "MiB"]),
    mask: Some("give a mask of what is no image"),
    rectify: Some("Rectification.of_pair()"),
    unit: Some("state the right one by Calibration(..., unit=\"m\") or Rig.of(..., unit=\"m\")"),
    crop: Some("Calibration(..., crop=(x, y, width, height))"),
    ..Vocabulary::PLAIN
};

/// An error with its remedy.
pub(crate) fn error(error: &Error) -> String {
    remedy::error(error, &WORDS)
}

/// An error of what the calibration of the files `names` says; `None` for other errors.
pub(crate) fn calibration(error: &Error, names: &str) -> Option<String> {
    match error {
        Error::Calibration(_) => Some(format!("{names}: {error}")),
        Error::Mismatch(cause) => Some(format!(
            "{names}: {cause}; size is (width, height), and Calibration(..., crop=(x, y, width, height)) says which part of the calibrated \
             images others show"
        )),
        _ => None,
    }
}

/// A doubt about what the calibration of the files `names` says, with its remedy.
pub(crate) fn doubt(doubt: &Doubt, names: &str) -> String {
    format!("{names}: {}", remedy::doubt(doubt, &WORDS))
}

/// A warning with its remedy.
pub(crate) fn warning(warning: &Warning) -> String {
    remedy::warning(warning, &WORDS)
}
