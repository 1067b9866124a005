//! How images are rectified.

use std::path::PathBuf;

use mrfgs::rectification::Options;
use serde::Serialize;

use crate::failure::{Failure, Result};

/// The calibration that rectifies, and how.
#[derive(clap::Args, Serialize)]
pub(crate) struct RectificationArgs {
    /// How much to show, from 0 (only pixels that have a source) to 1 (all pixels of the images). Without it
    /// the rectification is that of the calibration if it has one, else one that keeps the focal length
    /// (fisheyes: 0)
    #[arg(long, value_name = "0..1", allow_negative_numbers = true, value_parser = alpha)]
    pub(crate) alpha: Option<f64>,
}

impl RectificationArgs {
    pub(crate) fn options(&self) -> Options {
        Options { alpha: self.alpha, ..Options::default() }
    }

    /// The options where images are to be rectified. Else they take none.
    pub(crate) fn options_if(&self, rectifies: bool) -> Result<Option<Options>> {
        if self.alpha.is_some() && !rectifies {
            let reason = "is of a rectification; add --rectify, or leave --alpha out";
            return Err(Failure::usage("--alpha", reason));
        }
        Ok(rectifies.then(|| self.options()))
    }
}

fn alpha(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number| (0.0..=1.0).contains(number));
    number.ok_or_else(|| "give a number from 0 to 1".into())
}

/// The files of a calibration, as messages name them.
pub(crate) fn shown(files: &[PathBuf]) -> String {
    files.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}
