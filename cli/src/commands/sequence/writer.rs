//! Destinations for the maps of a sequence.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use mrfgs::Error;
use mrfgs::calibration::cameras::ThirdCamera;
use mrfgs::calibration::matrix::Matrix;
use mrfgs::depth::Rig;
use mrfgs::image::{Georeference, Pair, write::Growing};
use mrfgs::maps::Maps;
use mrfgs::options::DisparityRange;
use mrfgs::sigma::Sigma;
use mrfgs::steady::Steady;
use mrfgs_ros::messages::{Header, SECOND, Stamp};

use crate::args::Sign;
use crate::console;
use crate::failure::Result;
use crate::outputs::messages::Messages;
use crate::outputs::{Film, MapArgs, Outcome, RecordedMaps, ShownMaps, files, is_printed};
use crate::sequences::FrameRate;

/// Frames per second if nothing else tells.
const RATE: FrameRate = (25, 1);

/// Settings of the outputs of every frame.
pub(super) struct Writer<'a> {
    pub(super) output: &'a Path,
    pub(super) wanted: &'a MapArgs,
    pub(super) range: DisparityRange,
    pub(super) rig: Option<Rig>,
    pub(super) sigma: Sigma,
    /// The rotation from the left camera's frame to the rectified frame, if frames are rectified.
    pub(super) rectifying: Option<Matrix>,
    /// The camera of `--into`.
    pub(super) third: Option<ThirdCamera>,
    /// The frame rate, if known.
    pub(super) rate: Option<FrameRate>,
    /// Temporal smoothing (`--steady`).
    pub(super) steady: Option<Steady>,
}

/// A matched frame.
pub(super) struct MatchedFrame {
    pub(super) name: String,
    /// Time and camera, for a recorded frame.
    pub(super) header: Option<Header>,
    pub(super) maps: Maps,
    /// The georeferences of both views.
    pub(super) georeferences: [Option<Georeference>; 2],
    /// The pair, if an output shows it.
    pub(super) pair: Option<Pair>,
    /// The record as a line of JSON, if selected.
    pub(super) record: Option<String>,
}

/// The destination of the records.
pub(super) enum Records {
    Printed,
    File(PathBuf, Growing),
}

impl Records {
    /// Records in the file `path`, or `-` for standard output.
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

/// The destination of the maps.
#[allow(clippy::large_enum_variant, reason = "there is one of it")]
enum Destination {
    Folder,
    Film(Film),
    Recording(RecordedMaps),
    Viewer(ShownMaps),
}

/// An output and the state of writing it.
pub(super) struct Sink<'a> {
    writer: Writer<'a>,
    to: Destination,
    /// The number of frames written.
    count: usize,
    records: Option<Records>,
}

impl<'a> Writer<'a> {
    fn begin(self, to: Destination, records: Option<Records>) -> Sink<'a> {
        Sink { writer: self, to, count: 0, records }
    }

    /// Begins a film.
    pub(super) fn begin_film(self, records: Option<Records>) -> Sink<'a> {
        let film = Destination::Film(Film::new(self.output, self.rate));
        self.begin(film, records)
    }

    /// Begins a recording of these `messages`.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(super) fn begin_recording(self, messages: Messages, records: Option<Records>) -> Result<Sink<'a>> {
        let recording = Destination::Recording(RecordedMaps::new(self.output, messages)?);
        Ok(self.begin(recording, records))
    }

    /// Begins to serve these `messages` at an address. Returns the URL.
    ///
    /// # Errors
    /// If it cannot listen there.
    pub(super) fn begin_viewer(
        self,
        address: &str,
        messages: Messages,
        records: Option<Records>,
    ) -> Result<(Sink<'a>, String)> {
        let shown = ShownMaps::new(address, messages)?;
        let address = shown.address();
        Ok((self.begin(Destination::Viewer(shown), records), address))
    }

    /// Begins a folder, which may exist.
    ///
    /// # Errors
    /// If it cannot be created, or its format cannot store the range.
    pub(super) fn begin_folder(self, records: Option<Records>) -> Result<Sink<'a>> {
        let is_new = files::create_folder(self.output).map_err(|e| Error::write(self.output, e))?;
        let checked = self.wanted.check(self.output, "000000", self.range);
        if checked.is_err() && is_new {
            let _ = fs::remove_dir(self.output);
        }
        checked?;
        Ok(self.begin(Destination::Folder, records))
    }
}

impl Sink<'_> {
    /// Whether it needs the pair.
    pub(super) fn takes_pair(&self) -> bool {
        self.writer.wanted.also.show_left() || self.writer.steady.is_some()
    }

    /// Whether it needs records.
    pub(super) fn takes_records(&self) -> bool {
        self.records.is_some()
    }

    /// Writes a frame.
    pub(super) fn add(&mut self, mut found: MatchedFrame) -> Result<()> {
        if let (Some(steady), Some(pair)) = (&mut self.writer.steady, &found.pair) {
            steady.follow(pair.left(), &mut found.maps);
        }
        let Writer { output, wanted, range, rig, sigma, rectifying, third, rate, .. } = self.writer;
        let (maps, left) = (&found.maps, found.pair.as_ref().map(Pair::left));
        let georeferences = found.georeferences.clone();
        let (sign, sigma) = (Sign::default(), Some(sigma));
        let outcome = Outcome { maps, range, sign, left, rig, rectifying, third, sigma, georeferences };
        match &mut self.to {
            Destination::Folder => wanted.write(output, &found.name, &outcome)?,
            Destination::Film(film) => film.add(&wanted.also.film_picture(&outcome))?,
            Destination::Recording(_) | Destination::Viewer(_) => {
                let header = found.header.clone().unwrap_or_else(|| header(&found.name, self.count, rate));
                let map = outcome.final_map(wanted.also.limits);
                let (sigma, contents) = (outcome.typical_sigma(), wanted.also.contents(&outcome));
                match &mut self.to {
                    Destination::Recording(recording) => recording.add(&header, &map, sigma, contents)?,
                    Destination::Viewer(viewer) => viewer.add(&header, &map, sigma, contents)?,
                    Destination::Folder | Destination::Film(_) => {}
                }
            }
        }
        self.count += 1;
        match (&mut self.records, &found.record) {
            (Some(records), Some(record)) => records.add(record),
            _ => Ok(()),
        }
    }

    /// Ends a film or a recording, and the records.
    pub(super) fn finish(&mut self) -> Result<()> {
        let ended = match std::mem::replace(&mut self.to, Destination::Folder) {
            Destination::Folder | Destination::Viewer(_) => Ok(()),
            Destination::Film(film) => film.finish(),
            Destination::Recording(recording) => recording.finish(),
        };
        self.records.take().map_or(Ok(()), Records::finish)?;
        Ok(ended?)
    }
}

/// The header of a frame that was not recorded: its time is in its name, or follows from its number.
fn header(name: &str, count: usize, rate: Option<FrameRate>) -> Header {
    let (frames, seconds) = rate.unwrap_or(RATE);
    let of_number = || Stamp((count as i128 * i128::from(SECOND) * seconds as i128 / frames as i128) as i64);
    Header { stamp: time_in(name).unwrap_or_else(of_number), frame_id: "left".into() }
}

/// Parses a name that is a time: seconds with decimals, or nanoseconds of 19 digits.
fn time_in(name: &str) -> Option<Stamp> {
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    match name.split_once('.') {
        Some((seconds, decimals)) if is_number(seconds) && is_number(decimals) && decimals.len() <= 9 => {
            let nanoseconds = format!("{decimals:0<9}").parse::<i64>().ok()?;
            Some(Stamp(seconds.parse::<i64>().ok()?.checked_mul(SECOND)?.checked_add(nanoseconds)?))
        }
        None if is_number(name) && name.len() == 19 => name.parse().ok().map(Stamp),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_without_a_header_have_a_time() {
        for (name, count, time) in [
            ("1699999999.123456789", 7, 1_699_999_999_123_456_789),
            ("1305031102.175304", 7, 1_305_031_102_175_304_000),
            ("1403636579763555584", 7, 1_403_636_579_763_555_584),
            ("000007", 7, 280_000_000),
            ("frame.7", 1, 40_000_000),
            ("99999999999999999999.5", 0, 0),
        ] {
            assert_eq!(header(name, count, None).stamp, Stamp(time), "{name}");
        }
        assert_eq!(header("a", 3, Some((30_000, 1001))).stamp, Stamp(100_100_000));
    }
}
