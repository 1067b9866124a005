//! The maps of many pairs, each set named after its pair.

use std::path::Path;

use clap::ValueEnum;

use crate::outputs::also::{Also, AlsoArgs};

/// The maps to write of each pair.
#[derive(clap::Args)]
pub(crate) struct MapArgs {
    /// Format of the disparity maps, as the extensions of `mrfgs match`
    #[arg(long, value_enum, default_value_t, value_name = "WHICH")]
    pub(crate) format: Format,
    #[command(flatten)]
    pub(crate) also: AlsoArgs,
}

impl MapArgs {
    /// The name of the disparity map of a pair.
    pub(crate) fn map(&self, name: &str) -> String {
        format!("{name}.{}", self.format.extension())
    }

    /// The wanted outputs beside it, with their names.
    pub(crate) fn also(&self, name: &str) -> impl Iterator<Item = (&'static Also, String)> {
        let map = self.map(name);
        self.also.wanted().map(move |word| (word, word.beside(Path::new(&map)).display().to_string()))
    }
}

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
