//! How images, masks and maps are read.

use std::path::{Path, PathBuf};

use mrfgs::image::Plane;
use mrfgs::image::read::{MAX_PIXELS, Reader};
use serde::{Serialize, Serializer};

use crate::failure::{Failure, Result};

/// How images, masks and maps are read.
#[derive(clap::Args, Serialize)]
pub(crate) struct ReadingArgs {
    /// Ignores pixels that have this value in every channel, as the file stores it [default: the no-data
    /// value that a TIFF file names]
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    #[serde(serialize_with = "in_words")]
    pub(crate) no_data: Option<f64>,
    /// Largest number of pixels of an image; a file that claims more is refused before it takes memory
    #[arg(
        long,
        value_name = "N",
        allow_negative_numbers = true,
        default_value_t = MAX_PIXELS,
        value_parser = clap::value_parser!(u64).range(1..)
    )]
    // It refuses images, and changes none.
    #[serde(skip)]
    pub(crate) max_pixels: u64,
    /// Turns images and masks upright that are stored turned, as the orientation tag of EXIF or TIFF says.
    /// Otherwise pixels are taken as they are stored, and a line says so
    #[arg(long)]
    pub(crate) orient: bool,
}

/// The scale of whole numbers in a map.
pub(crate) fn scale(text: &str) -> std::result::Result<f32, String> {
    let scale = text.parse().ok().filter(|scale| (0.1..=65535.0).contains(scale));
    scale.ok_or_else(|| "give a number from 0.1 to 65535, such as 3".into())
}

/// A disparity map by `reader`, of whole numbers by their `scale` where there is one.
pub(crate) fn disparity(reader: Reader, path: &Path, scale: Option<f32>) -> mrfgs::Result<Plane<f32>> {
    match scale {
        Some(scale) => reader.scaled_disparity(path, scale),
        None => reader.disparity(path),
    }
}

/// JSON has no numbers that are not finite.
#[allow(clippy::ref_option, reason = "serde hands it over so")]
fn in_words<S: Serializer>(value: &Option<f64>, to: S) -> Result<S::Ok, S::Error> {
    value.map(|value| value.to_string()).serialize(to)
}

impl ReadingArgs {
    /// The reader of images that are rectified: by a calibration of `files` as they are stored, and upright without one.
    pub(crate) fn raw_reader(&self, files: &[PathBuf]) -> Result<Reader> {
        if self.orient && !files.is_empty() {
            let reason = "a calibration is of the pixels as they are stored; leave --orient or --calib out";
            return Err(Failure::usage("--orient", reason));
        }
        Ok(Reader { orient: files.is_empty(), ..self.reader() })
    }

    pub(crate) fn reader(&self) -> Reader {
        Reader { max_pixels: self.max_pixels, no_data: self.no_data, orient: self.orient }
    }
}
