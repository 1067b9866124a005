//! Where the maps of a sequence go.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use mrfgs::Error;
use mrfgs::calibration::matrix::Matrix;
use mrfgs::depth::Rig;
use mrfgs::image::{Georeference, Pair, write, write::Growing};
use mrfgs::maps::Maps;
use mrfgs::options::DisparityRange;

use crate::args::Sign;
use crate::console;
use crate::failure::Result;
use crate::outputs::{Film, MapArgs, Outcome, files, is_printed};
use crate::sequences::FrameRate;

/// What is written of every frame.
pub(super) struct Writer<'a> {
    pub(super) output: &'a Path,
    pub(super) wanted: &'a MapArgs,
    pub(super) range: DisparityRange,
    pub(super) rig: Option<Rig>,
    /// The rotation from the frame of the left camera to the rectified one, where frames are rectified.
    pub(super) rectifying: Option<Matrix>,
}

/// A frame that has been matched.
pub(super) struct Found {
    pub(super) name: String,
    pub(super) maps: Maps,
    /// Those of both views.
    pub(super) georeferences: [Option<Georeference>; 2],
    /// The pair, where an output shows it.
    pub(super) pair: Option<Pair>,
    /// What ran and what it found, as a line of JSON, where that is asked for.
    pub(super) record: Option<String>,
}

/// Where the records of the frames go.
pub(super) enum Records {
    Printed,
    File(PathBuf, Growing),
}

impl Records {
    /// In the file `path`, or `-` for standard output.
    pub(super) fn new(path: &Path) -> Result<Self> {
        if is_printed(path) {
            Ok(Self::Printed)
        } else {
            Ok(Self::File(path.to_owned(), Growing::new(path)?))
        }
    }

    fn add(&mut self, record: &str) -> Result<()> {
        match self {
            Self::Printed => Ok(console::print(record)?),
            Self::File(path, file) => {
                Ok(file.write_all(record.as_bytes()).map_err(|e| Error::write(path, e))?)
            }
        }
    }

    fn finish(self) -> Result<()> {
        match self {
            Self::Printed => Ok(()),
            Self::File(_, file) => Ok(file.finish()?),
        }
    }
}

/// The folder or the film, with what is in it so far.
pub(super) struct Sink<'a> {
    writer: Writer<'a>,
    film: Option<Film>,
    records: Option<Records>,
}

impl<'a> Writer<'a> {
    /// Begins a film of `rate` frames a second.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub(super) fn begin_film(self, rate: Option<FrameRate>, records: Option<Records>) -> Result<Sink<'a>> {
        if !is_printed(self.output) {
            write::check_path(self.output)?;
        }
        let film = Some(Film::new(self.output, rate));
        Ok(Sink { writer: self, film, records })
    }

    /// Begins a folder, which may be there.
    ///
    /// # Errors
    /// Where it cannot be made, or a map cannot be stored in its format.
    pub(super) fn begin_folder(self, records: Option<Records>) -> Result<Sink<'a>> {
        let is_new = files::create_folder(self.output).map_err(|e| Error::write(self.output, e))?;
        let checked = self.wanted.check(self.output, "000000", self.range);
        if checked.is_err() && is_new {
            let _ = fs::remove_dir(self.output);
        }
        checked?;
        Ok(Sink { writer: self, film: None, records })
    }
}

impl Sink<'_> {
    /// Whether it takes the pair, too.
    pub(super) fn takes_pair(&self) -> bool {
        self.writer.wanted.also.show_left()
    }

    /// Whether it takes records.
    pub(super) fn takes_records(&self) -> bool {
        self.records.is_some()
    }

    /// Writes a frame.
    pub(super) fn add(&mut self, found: &Found) -> Result<()> {
        let Writer { output, wanted, range, rig, rectifying } = self.writer;
        let (maps, left) = (&found.maps, found.pair.as_ref().map(Pair::left));
        let georeferences = found.georeferences.clone();
        let outcome = Outcome { maps, range, sign: Sign::default(), left, rig, rectifying, georeferences };
        match &mut self.film {
            Some(film) => film.add(&wanted.also.film_picture(&outcome))?,
            None => wanted.write(output, &found.name, &outcome)?,
        }
        match (&mut self.records, &found.record) {
            (Some(records), Some(record)) => records.add(record),
            _ => Ok(()),
        }
    }

    /// Ends film and records.
    pub(super) fn finish(&mut self) -> Result<()> {
        let film = self.film.take().map_or(Ok(()), Film::finish);
        self.records.take().map_or(Ok(()), Records::finish)?;
        Ok(film?)
    }
}
