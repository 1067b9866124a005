//! The pairs of a batch: rows of a list, or the folders in a folder. A list with a mistake is refused as a whole.

use std::fs;
use std::path::{Path, PathBuf};

use mrfgs::Error;
use mrfgs::depth::Rig;
use mrfgs::image::read::Reader;
use mrfgs::rectification::Options;

use crate::args::{CropArgs, Search, Sign};
use crate::failure::{Failure, Result};
use crate::outputs::{Also, Files};
use crate::pairs::folder::{self, CALIBRATION, Folder};
use crate::pairs::input;
use crate::pairs::list::{self, Names, Row};

/// Many pairs.
pub(super) struct List {
    /// What the paths of the pairs count from.
    pub(super) base: PathBuf,
    pub(super) pairs: Vec<Listed>,
}

/// One pair of a [`List`].
pub(super) struct Listed {
    pub(super) name: String,
    source: Source,
}

/// The source of a pair; paths are as the list has them.
enum Source {
    Row(Row),
    /// The folder in [`List::base`] that has the pair's name.
    Folder,
}

/// What all pairs have in common that the list does not say.
pub(super) struct Given<'a> {
    /// The calibration of pairs for which the list has none.
    pub(super) calib: &'a [PathBuf],
    /// The part of the calibrated images that the images show.
    pub(super) crop: &'a CropArgs,
    /// How the images are rectified, where they are as the cameras took them.
    pub(super) rectify: Option<Options>,
    /// The output that takes the cameras.
    pub(super) cameras: Option<&'a Also>,
    /// The file of the camera that an output is in the view of.
    pub(super) into: Option<&'a Path>,
}

/// A pair, read.
pub(super) struct Read {
    pub(super) input: input::Input,
    /// The cameras, where an output takes them.
    pub(super) rig: Option<Rig>,
    /// Without the output, which the reader does not know.
    pub(super) files: Files,
}

impl List {
    /// Reads the list `path`, or the names of the folders in the folder `path`.
    ///
    /// # Errors
    /// [`Error::Read`] with the line, where there is one, for what cannot be read, makes no sense or is empty.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let list = if path.is_dir() { Self::of_folders(path)? } else { Self::of_rows(path)? };
        if list.pairs.is_empty() {
            let reason =
                "lists no pair; give a CSV file with a row for each, or a folder with a folder for each";
            return Err(Error::read(path, reason).into());
        }
        Ok(list)
    }

    fn of_rows(path: &Path) -> Result<Self> {
        let rows = list::read(path)?.into_iter();
        let pairs = rows.map(|row| Listed { name: row.name.clone(), source: Source::Row(row) });
        Ok(Self { base: path.parent().unwrap_or(Path::new("")).to_owned(), pairs: pairs.collect() })
    }

    /// A pair for each folder that is not hidden, in the order of their names.
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
    /// Every file that is there and may be read of it, as the list has it, or the flags.
    pub(super) fn inputs(&self, base: &Path, given: &Given) -> Vec<String> {
        let inputs = match &self.source {
            Source::Row(Row { left, right, mask, calibration, max_disparity, .. }) => {
                let takes_calibration = given.cameras.is_some() || max_disparity.is_none();
                let beside = Some(calibration_beside(left))
                    .filter(|_| takes_calibration && calibration.is_empty() && given.calib.is_empty());
                [left]
                    .into_iter()
                    .chain(right)
                    .chain(mask)
                    .chain(calibration)
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
        // Those of the flags do not start at the list.
        let shared = shared.filter_map(|path| path.canonicalize().ok()).map(|path| shown(&path));
        own.chain(shared).collect()
    }

    /// Whether the list says its calibration.
    fn has_calibration(&self) -> bool {
        matches!(&self.source, Source::Row(row) if !row.calibration.is_empty())
    }

    /// What the list says of its range.
    pub(super) fn search(&self) -> Search {
        match &self.source {
            &Source::Row(Row { max_disparity, min_disparity, .. }) => {
                Search { max_disparity, min_disparity, ..Search::default() }
            }
            Source::Folder => Search::default(),
        }
    }

    /// Reads its images and what else its range takes, and the cameras where an output takes them.
    pub(super) fn read(&self, base: &Path, reader: Reader, given: &Given) -> Result<Read> {
        let at = |path: &String| base.join(path);
        let mut calib = given.calib.to_vec();
        let (pair, range, [left, right], mask) = match &self.source {
            Source::Row(Row { left, right, mask, calibration, .. }) => {
                if !calibration.is_empty() {
                    calib = calibration.iter().map(at).collect();
                }
                let (other, mask_file) = (right.as_ref().map(at), mask.as_ref().map(at));
                let views = if given.rectify.is_some() { input::raw_views } else { input::views };
                let pair = views(reader, &at(left), other.as_deref(), mask_file.as_deref())?;
                (pair, None, [left, right.as_ref().unwrap_or(left)].map(Clone::clone), mask.clone())
            }
            // Its calibration and its truth are of rectified images.
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
        if given.rectify.is_some() && calib.is_empty() {
            let reason =
                "takes a calibration; give one in the column calibration, or one for all with --calib";
            return Err(Failure::usage("--rectify", reason));
        }
        let left_image = at(&left);
        let beside = Some(&*left_image).filter(|_| given.cameras.is_some() || search.takes_calibration());
        let input = input::Input::new(
            pair,
            &search,
            Sign::default(),
            input::Calib::Files(&calib, given.crop),
            None,
            given.rectify.as_ref(),
            beside,
        )?;
        let rig = input.rig(given.cameras, &left_image)?;
        let calibration = match &self.source {
            Source::Row(row) if self.has_calibration() => Some(row.calibration.join(", ")),
            _ if !calib.is_empty() => input.calibration_files(),
            Source::Row(_) => input.calibration_files().map(|_| calibration_beside(&left)),
            Source::Folder => Some(calibration_beside(&left)).filter(|path| at(path).exists()),
        };
        let files = Files { left, right, mask, calibration, output: None };
        Ok(Read { input, rig, files })
    }

    /// The paths of the views in the folder `dir`, as a list would have them.
    fn views_of(&self, dir: &Path) -> Result<[String; 2]> {
        let names = Folder::to_match(dir)?.view_names();
        Ok(names.map(|file| shown(&Path::new(&self.name).join(file))))
    }
}

pub(super) fn shown(path: &Path) -> String {
    path.display().to_string()
}

fn calibration_beside(left: &str) -> String {
    shown(&Path::new(left).with_file_name(CALIBRATION))
}
