//! Messages of the library with remedies for Python users.

use mrfgs::Error;
use mrfgs::check::Warning;
use mrfgs::rectification::Doubt;
use mrfgs::remedy::{self, Vocabulary};

const WORDS: Vocabulary = Vocabulary {
    key: ["options[\"", "\"]"],
    min: "min_disparity",
    max: "max_disparity",
    cpu: "use device=\"cpu\"",
    fork: "start it with multiprocessing.get_context(\"spawn\") or \"forkserver\", or make no Matcher with a device before the fork",
    memory: Some(["memory", "MiB"]),
    mask: Some("give a mask of everything that is not image"),
    max_pixels: Some("max_pixels of Blocks or PairWindows,"),
    rectify: Some("rectify it first with Rectification(calibration), or Rectification.of_pair() without one"),
    unit: Some("set the right one with Calibration(..., unit=\"m\") or Rig.of(..., unit=\"m\")"),
    crop: Some("Calibration(..., crop=(x, y, width, height))"),
    ..Vocabulary::PLAIN
};

/// An error with its remedy.
pub(crate) fn error(error: &Error) -> String {
    remedy::error(error, &WORDS)
}

/// An error about the calibration in the files `names`; `None` for other errors.
pub(crate) fn calibration(error: &Error, names: &str) -> Option<String> {
    match error {
        Error::Calibration(_) => Some(format!("{names}: {error}")),
        Error::Mismatch(cause) => Some(format!(
            "{names}: {cause}; size is (width, height), and Calibration(..., crop=(x, y, width, height)) selects the part of the calibrated \
             images that yours show"
        )),
        _ => None,
    }
}

/// A doubt about the calibration in the files `names`, with its remedy.
pub(crate) fn doubt(doubt: &Doubt, names: &str) -> String {
    format!("{names}: {}", remedy::doubt(doubt, &WORDS))
}

/// A warning with its remedy.
pub(crate) fn warning(warning: &Warning) -> String {
    remedy::warning(warning, &WORDS)
}
