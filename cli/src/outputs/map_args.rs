//! Output files of many pairs, each set named after its pair.

use std::path::Path;

use clap::ValueEnum;
use mrfgs::image::write;
use mrfgs::options::DisparityRange;
use serde::Serialize;

use crate::failure::Result;
use crate::outputs::also::Also;
use crate::outputs::also_args::AlsoArgs;
use crate::outputs::files::Written;
use crate::outputs::outcome::{Outcome, View};

/// Flags of the maps to write for each pair.
#[derive(clap::Args, Serialize)]
pub(crate) struct MapArgs {
    /// Format of the disparity maps [default: pfm]
    #[arg(long, value_enum, value_name = "WHICH")]
    // Not recorded: the file names tell.
    #[serde(skip)]
    pub(crate) format: Option<Format>,
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) also: AlsoArgs,
}

impl MapArgs {
    /// The file name of a pair's disparity map.
    pub(crate) fn map(&self, name: &str) -> String {
        format!("{name}.{}", self.format.unwrap_or_default().extension())
    }

    /// The selected further outputs of a pair, with their file names.
    pub(crate) fn also(&self, name: &str) -> impl Iterator<Item = (&'static Also, String)> {
        let map = self.map(name);
        self.also.wanted().map(move |word| (word, word.beside(Path::new(&map)).display().to_string()))
    }

    /// Checks before any computing that the outputs of a pair can be written to `folder`, with disparities in `range`.
    pub(crate) fn check(&self, folder: &Path, name: &str, range: DisparityRange) -> mrfgs::Result<()> {
        write::check_disparity_path(&folder.join(self.map(name)), range.min, range.max)?;
        self.also(name).try_for_each(|(word, file)| word.check(&folder.join(file), range))
    }

    /// Writes the outputs of a pair to `folder`, all or none.
    pub(crate) fn write(&self, folder: &Path, name: &str, outcome: &Outcome) -> Result<()> {
        let map = folder.join(self.map(name));
        let mut written = Written::default();
        written
            .note(&map, outcome.writer(View::Left).disparity(&map, &outcome.final_map(self.also.limits)))?;
        for (word, file) in self.also(name) {
            let path = folder.join(file);
            written.note(&path, self.also.write(word, &path, outcome))?;
        }
        written.keep();
        Ok(())
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
    /// The file extension, which is also the value of the flag.
    pub(crate) fn extension(self) -> String {
        self.to_possible_value().map(|word| word.get_name().to_owned()).unwrap_or_default()
    }
}
