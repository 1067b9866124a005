//! The pairs of a batch: rows of a list, folders in a folder, or the images in two folders. A list with a mistake is refused as a whole.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mrfgs::depth::Rig;
use mrfgs::image::read::Reader;
use mrfgs::rectification::Options;
use mrfgs::{Error, Prior};

use crate::args::{CameraNeed, CloudPose, CropArgs, PriorFile, PriorNames, PriorView, Search, Sign};
use crate::failure::{Failure, Result};
use crate::outputs::{Also, Files};
use crate::pairs::folder::{self, CALIBRATION, Folder};
use crate::pairs::input;
use crate::pairs::list::{self, Names, PriorRow, Row};
use crate::text::shown;

use super::cameras;

/// The columns of a prior, for messages.
const PRIOR_COLUMNS: PriorNames =
    PriorNames { file: "prior", kind: "prior_kind", unit: "prior_unit", pose: "prior_pose" };

/// A list of pairs.
pub(super) struct List {
    /// The folder that relative paths start at.
    pub(super) base: PathBuf,
    pub(super) pairs: Vec<Listed>,
}

/// One pair of a [`List`].
pub(super) struct Listed {
    pub(super) name: String,
    source: Source,
}

/// The source of a pair; paths are as written in the list.
#[allow(clippy::large_enum_variant, reason = "nearly all are rows")]
enum Source {
    Row(Row),
    /// The folder in [`List::base`] named after the pair.
    Folder,
}

/// Settings from flags, which apply to all pairs.
pub(super) struct BatchSettings<'a> {
    /// The calibration of pairs without one in the list.
    pub(super) calib: &'a [PathBuf],
    /// The crop of the calibrated images that the images show.
    pub(super) crop: &'a CropArgs,
    /// How to rectify the images, if they are raw.
    pub(super) rectify: Option<Options>,
    /// An output that needs the cameras, if there is one.
    pub(super) cameras: Option<&'a Also>,
    /// The file of `--into`.
    pub(super) into: Option<&'a Path>,
}

/// A pair with its inputs.
pub(super) struct LoadedPair {
    pub(super) input: input::Input,
    /// The cameras, if an output needs them.
    pub(super) rig: Option<Rig>,
    pub(super) prior: Option<Arc<Prior>>,
    /// The paths, without the output.
    pub(super) files: Files,
}

impl List {
    /// Reads the list `path`, or finds the pairs in the folder `path`.
    ///
    /// # Errors
    /// [`Error::Read`], with the line number if there is one, for a list that is unreadable, malformed or empty.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let list = if !path.is_dir() {
            Self::of_rows(path.parent().unwrap_or(Path::new("")), list::read(path)?)
        } else if let Some(rows) = cameras::pairs(path)? {
            Self::of_rows(path, rows)
        } else {
            Self::of_folders(path)?
        };
        if list.pairs.is_empty() {
            let reason = "contains no pairs; give a CSV file with a row per pair, a folder with a folder per pair, or one with the \
                          images in the folders left and right, or with .mpo files";
            return Err(Error::read(path, reason).into());
        }
        Ok(list)
    }

    /// The pairs in `rows`, whose relative paths start at `base`.
    fn of_rows(base: &Path, rows: Vec<Row>) -> Self {
        let pairs = rows.into_iter().map(|row| Listed { name: row.name.clone(), source: Source::Row(row) });
        Self { base: base.to_owned(), pairs: pairs.collect() }
    }

    /// A pair for each visible folder, in the order of their names.
    fn of_folders(path: &Path) -> Result<Self> {
        let mut found = Vec::new();
        for entry in fs::read_dir(path).map_err(|e| Error::read(path, e))? {
            let entry = entry.map_err(|e| Error::read(path, e))?;
            let name = entry.file_name().to_string_lossy().into_owned();
            if !name.starts_with('.') && entry.path().is_dir() {
                found.push((name, entry.path()));
            }
        }
        found.sort();
        let mut names = Names::default();
        let mut pairs = Vec::new();
        for (name, folder) in found {
            names.add(&name, 0).map_err(|reason| Error::read(folder, reason))?;
            pairs.push(Listed { name, source: Source::Folder });
        }
        Ok(Self { base: path.to_owned(), pairs })
    }
}

impl Listed {
    /// Every existing input file of the pair: paths from the list as written, paths from flags absolute.
    pub(super) fn inputs(&self, base: &Path, given: &BatchSettings) -> Vec<String> {
        let inputs = match &self.source {
            Source::Row(Row { left, right, mask, calibration, max_disparity, prior, .. }) => {
                let need = prior.as_ref().and_then(|row| prior_file(row, row.file.as_ref(), None).need());
                let takes_calibration = given.cameras.is_some() || max_disparity.is_none() || need.is_some();
                let beside = Some(calibration_beside(left))
                    .filter(|_| takes_calibration && calibration.is_empty() && given.calib.is_empty());
                [left]
                    .into_iter()
                    .chain(right)
                    .chain(mask)
                    .chain(calibration)
                    .chain(prior.as_ref().map(|prior| &prior.file))
                    .chain(prior.as_ref().and_then(|prior| prior.pose.as_ref()))
                    .cloned()
                    .chain(beside)
                    .collect()
            }
            Source::Folder => {
                folder::inputs(Path::new(&self.name)).map(|path| shown(&path)).collect::<Vec<_>>()
            }
        };
        let own = inputs.into_iter().filter(|path| base.join(path).exists());
        let shared =
            given.calib.iter().filter(|_| !self.has_calibration()).map(PathBuf::as_path).chain(given.into);
        // Paths from flags are not relative to the list.
        let shared = shared.filter_map(|path| path.canonicalize().ok()).map(|path| shown(&path));
        own.chain(shared).collect()
    }

    /// Whether the list gives a calibration for the pair.
    fn has_calibration(&self) -> bool {
        matches!(&self.source, Source::Row(row) if !row.calibration.is_empty())
    }

    /// The known disparities of the left view that the list names, if any.
    pub(super) fn prior(&self) -> Option<&PriorRow> {
        match &self.source {
            Source::Row(row) => row.prior.as_ref(),
            Source::Folder => None,
        }
    }

    /// The range in the list.
    pub(super) fn search(&self) -> Search {
        match &self.source {
            &Source::Row(Row { max_disparity, min_disparity, .. }) => {
                Search { max_disparity, min_disparity, ..Search::default() }
            }
            Source::Folder => Search::default(),
        }
    }

    /// Reads the images, resolves the range, and reads the cameras if an output needs them.
    pub(super) fn read(&self, base: &Path, reader: Reader, given: &BatchSettings) -> Result<LoadedPair> {
        let at = |path: &String| base.join(path);
        let calib = match &self.source {
            Source::Row(row) if !row.calibration.is_empty() => row.calibration.iter().map(at).collect(),
            _ => given.calib.to_vec(),
        };
        // How to rectify the pair without a calibration.
        let alone = given.rectify.as_ref().filter(|_| calib.is_empty());
        let reader = Reader { orient: reader.orient || alone.is_some(), ..reader };
        let (pair, range, [left, right], mask) = match &self.source {
            Source::Row(Row { left, right, mask, .. }) => {
                let (other, mask_file) = (right.as_ref().map(at), mask.as_ref().map(at));
                let is_raw = given.rectify.is_some() && alone.is_none();
                let views = if is_raw { input::raw_views } else { input::views };
                let pair = views(reader, &at(left), other.as_deref(), mask_file.as_deref())?;
                (pair, None, [left, right.as_ref().unwrap_or(left)].map(Clone::clone), mask.clone())
            }
            // The calib.txt and the ground truth belong to rectified images, so they are not used.
            Source::Folder if given.rectify.is_some() => {
                let dir = at(&self.name);
                let pair = Folder::to_match(&dir)?.views(reader)?;
                (pair, None, self.views_of(&dir)?, None)
            }
            Source::Folder => {
                let dir = at(&self.name);
                let (pair, range) = Folder::to_match(&dir)?.read_pair(reader)?;
                (pair, Some(range), self.views_of(&dir)?, None)
            }
        };
        let search = range.map_or_else(|| self.search(), Search::from);
        let left_image = at(&left);
        let pose = self.prior().and_then(|prior| prior.pose.as_ref()).map(at);
        let prior_path = self.prior().map(|prior| at(&prior.file));
        let prior = self.prior().zip(prior_path.as_deref());
        let prior = prior.map(|(row, path)| prior_file(row, path, pose.as_deref()));
        let of_prior = prior.as_ref().and_then(PriorFile::need);
        let need = CameraNeed::strictest([given.cameras.map(Also::need), of_prior]);
        let input = if let Some(options) = alone {
            if let Some(need) = need.as_ref().filter(|need| !need.optional) {
                let reason = "without a calibration there is no scale and so no depth; give one per pair in the column calibration, or \
                              one for all with --calib";
                return Err(Failure::usage(&need.flag, reason));
            }
            let (by, pair) = input::rectify_alone([&left_image, &at(&right)], &pair, options)?;
            input::Input::rectified_alone(pair, by, &search, Sign::default())?
        } else {
            let beside = Some(&*left_image).filter(|_| need.is_some() || search.takes_calibration());
            let calib = input::Calib::Files(&calib, given.crop);
            input::Input::new(pair, &search, Sign::default(), calib, None, given.rectify.as_ref(), beside)?
        };
        let known = input.rig(need.as_ref(), &left_image)?;
        let rig = known.filter(|_| given.cameras.is_some());
        let calibration = match &self.source {
            Source::Row(row) if self.has_calibration() => Some(row.calibration.join(", ")),
            _ if !calib.is_empty() => input.calibration_files(),
            Source::Row(_) => input.calibration_files().map(|_| calibration_beside(&left)),
            Source::Folder => {
                Some(calibration_beside(&left)).filter(|path| alone.is_none() && at(path).exists())
            }
        };
        let view = PriorView { size: input.pair.size(), sign: Sign::default(), rig: input.as_taken(known) };
        let prior = prior.map(|prior| prior.read(view)).transpose()?;
        let prior_file = self.prior().map(|prior| prior.file.clone());
        let files = Files { left, right, mask, calibration, prior: prior_file, output: None };
        Ok(LoadedPair { input, rig, prior, files })
    }

    /// The paths of the views in the folder `dir`, relative to the list.
    fn views_of(&self, dir: &Path) -> Result<[String; 2]> {
        let names = Folder::to_match(dir)?.view_names();
        Ok(names.map(|file| shown(&Path::new(&self.name).join(file))))
    }
}

/// The prior of a row, whose files are at these paths.
fn prior_file<'a>(row: &PriorRow, path: &'a Path, pose: Option<&'a Path>) -> PriorFile<'a> {
    let &PriorRow { sigma, kind, unit, .. } = row;
    PriorFile { path, sigma, kind, unit, pose: pose.map(CloudPose::File), names: PRIOR_COLUMNS }
}

fn calibration_beside(left: &str) -> String {
    shown(&Path::new(left).with_file_name(CALIBRATION))
}
