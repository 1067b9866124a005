//! How images, masks and maps are read.

use std::path::{Path, PathBuf};

use mrfgs::image::Plane;
use mrfgs::image::read::{MAX_PIXELS, Reader};
use serde::{Serialize, Serializer};

use crate::failure::{Failure, Result};

#[derive(clap::Args, Serialize)]
pub(crate) struct ReadingArgs {
    /// Ignores pixels with this value in every channel, as stored in the file [default: the no-data value of a TIFF file]
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    #[serde(serialize_with = "in_words")]
    pub(crate) no_data: Option<f64>,
    /// Maximum number of pixels of an image; larger files are refused before they use memory
    #[arg(
        long,
        value_name = "N",
        allow_negative_numbers = true,
        default_value_t = MAX_PIXELS,
        value_parser = clap::value_parser!(u64).range(1..)
    )]
    // Not recorded: it can refuse an image but never changes one.
    #[serde(skip)]
    pub(crate) max_pixels: u64,
    /// Rotates images and masks upright according to their EXIF or TIFF orientation tag. Otherwise pixels are used as stored, with a
    /// warning
    #[arg(long)]
    pub(crate) orient: bool,
}

/// Parses the scale of integer maps, 0.1 to 65535.
pub(crate) fn scale(text: &str) -> std::result::Result<f32, String> {
    let scale = text.parse().ok().filter(|scale| (0.1..=65535.0).contains(scale));
    scale.ok_or_else(|| "give a number from 0.1 to 65535, such as 3".into())
}

/// Reads a disparity map; integers are divided by `scale` if given.
pub(crate) fn disparity(reader: Reader, path: &Path, scale: Option<f32>) -> mrfgs::Result<Plane<f32>> {
    match scale {
        Some(scale) => reader.scaled_disparity(path, scale),
        None => reader.disparity(path),
    }
}

/// Serializes the number as text, since JSON has no infinity and no NaN.
#[allow(clippy::ref_option, reason = "serde hands it over so")]
fn in_words<S: Serializer>(value: &Option<f64>, to: S) -> Result<S::Ok, S::Error> {
    value.map(|value| value.to_string()).serialize(to)
}

impl ReadingArgs {
    /// The reader of images to be rectified. A calibration (`files`) applies to pixels as stored; without one, images are rotated upright.
    pub(crate) fn raw_reader(&self, files: &[PathBuf]) -> Result<Reader> {
        if self.orient && !files.is_empty() {
            let reason = "a calibration applies to pixels as stored; remove --orient or --calib";
            return Err(Failure::usage("--orient", reason));
        }
        Ok(Reader { orient: files.is_empty(), ..self.reader() })
    }

    pub(crate) fn reader(&self) -> Reader {
        Reader { max_pixels: self.max_pixels, no_data: self.no_data, orient: self.orient }
    }
}
