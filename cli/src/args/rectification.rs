//! How images are rectified.

use std::path::PathBuf;

use mrfgs::rectification::Options;
use serde::Serialize;

use crate::failure::{Failure, Result};

/// Flags of a rectification.
#[derive(clap::Args, Serialize)]
pub(crate) struct RectificationArgs {
    /// How much of the images to keep when rectifying, from 0 (no empty borders) to 1 (all pixels). Default: the rectification stored in
    /// the calibration, else one that keeps the focal length (fisheyes: 0)
    #[arg(long, value_name = "0..1", allow_negative_numbers = true, value_parser = alpha)]
    pub(crate) alpha: Option<f64>,
}

impl RectificationArgs {
    pub(crate) fn options(&self) -> Options {
        Options { alpha: self.alpha, ..Options::default() }
    }

    /// The options if images are rectified, else `None`; refuses --alpha without a rectification.
    pub(crate) fn options_if(&self, rectifies: bool) -> Result<Option<Options>> {
        if self.alpha.is_some() && !rectifies {
            let reason = "needs a rectification; add --rectify, or remove --alpha";
            return Err(Failure::usage("--alpha", reason));
        }
        Ok(rectifies.then(|| self.options()))
    }
}

fn alpha(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number| (0.0..=1.0).contains(number));
    number.ok_or_else(|| "give a number from 0 to 1".into())
}

/// The paths of calibration files, for messages.
pub(crate) fn shown(files: &[PathBuf]) -> String {
    files.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}
