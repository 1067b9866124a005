//! Where the maps of a sequence go.

use std::fs;
use std::path::Path;

use mrfgs::Error;
use mrfgs::calibration::matrix::Matrix;
use mrfgs::depth::Rig;
use mrfgs::image::{Georeference, Pair, write};
use mrfgs::maps::Maps;
use mrfgs::options::DisparityRange;

use crate::args::Sign;
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
}

/// The folder or the film, with what is in it so far.
pub(super) struct Sink<'a> {
    writer: Writer<'a>,
    film: Option<Film>,
}

impl<'a> Writer<'a> {
    /// Begins a film of `rate` frames a second.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub(super) fn begin_film(self, rate: Option<FrameRate>) -> Result<Sink<'a>> {
        if !is_printed(self.output) {
            write::check_path(self.output)?;
        }
        let film = Some(Film::new(self.output, rate));
        Ok(Sink { writer: self, film })
    }

    /// Begins a folder, which may be there.
    ///
    /// # Errors
    /// Where it cannot be made, or a map cannot be stored in its format.
    pub(super) fn begin_folder(self) -> Result<Sink<'a>> {
        let is_new = files::create_folder(self.output).map_err(|e| Error::write(self.output, e))?;
        let checked = self.wanted.check(self.output, "000000", self.range);
        if checked.is_err() && is_new {
            let _ = fs::remove_dir(self.output);
        }
        checked?;
        Ok(Sink { writer: self, film: None })
    }
}

impl Sink<'_> {
    /// Whether it takes the pair, too.
    pub(super) fn takes_pair(&self) -> bool {
        self.writer.wanted.also.show_left()
    }

    /// Writes a frame.
    pub(super) fn add(&mut self, found: &Found) -> Result<()> {
        let Writer { output, wanted, range, rig, rectifying } = self.writer;
        let (maps, left) = (&found.maps, found.pair.as_ref().map(Pair::left));
        let georeferences = found.georeferences.clone();
        let outcome = Outcome { maps, range, sign: Sign::default(), left, rig, rectifying, georeferences };
        if let Some(film) = &mut self.film {
            return Ok(film.add(&wanted.also.film_picture(&outcome))?);
        }
        wanted.write(output, &found.name, &outcome)
    }

    /// Ends a film.
    pub(super) fn finish(&mut self) -> Result<()> {
        Ok(self.film.take().map_or(Ok(()), Film::finish)?)
    }
}
