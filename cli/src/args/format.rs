//! How the disparity maps of many pairs are stored.

use clap::ValueEnum;

/// The format of disparity maps.
#[derive(Clone, Copy, Default, ValueEnum)]
pub(crate) enum Format {
    /// Float, +infinity for invalid pixels
    #[default]
    Pfm,
    /// Float, NaN for invalid pixels
    Tif,
    /// 16 bits, disparity times 256, 0 for invalid pixels
    Png,
}

impl Format {
    /// The extension of their files.
    pub(crate) fn extension(self) -> &'static str {
        match self {
            Self::Pfm => "pfm",
            Self::Tif => "tif",
            Self::Png => "png",
        }
    }
}
