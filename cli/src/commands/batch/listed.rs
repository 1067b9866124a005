//! The pairs of a batch: rows of a list, or the folders in a folder. A list with a mistake is refused as a whole.

use std::fs;
use std::path::{Path, PathBuf};

use mrfgs::Error;
use mrfgs::depth::Rig;
use mrfgs::image::Pair;
use mrfgs::image::calib::Calibration;
use mrfgs::image::read::Reader;
use mrfgs::options::DisparityRange;

use crate::args::{Found, Search, Sign};
use crate::failure::Result;
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

/// A pair, read.
pub(super) struct Input {
    pub(super) pair: Pair,
    pub(super) range: DisparityRange,
    /// Whether sparse matches gave the range.
    pub(super) by_matches: bool,
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
    /// Every file that is there and may be read of it, as the list has it; with its calibration if an output takes the
    /// `cameras`.
    pub(super) fn inputs(&self, base: &Path, cameras: bool) -> Vec<String> {
        let inputs = match &self.source {
            Source::Row(Row { left, right, mask, max_disparity, .. }) => {
                let calibrated = cameras || max_disparity.is_none();
                let calibration = calibrated.then(|| calibration_beside(left));
                [left, right].into_iter().cloned().chain(calibration).chain(mask.clone()).collect()
            }
            Source::Folder => {
                folder::inputs(Path::new(&self.name)).map(|path| shown(&path)).collect::<Vec<_>>()
            }
        };
        inputs.into_iter().filter(|path| base.join(path).exists()).collect()
    }

    /// What the list says of its range.
    pub(super) fn search(&self) -> Search {
        match &self.source {
            &Source::Row(Row { max_disparity, min_disparity, .. }) => Search { max_disparity, min_disparity },
            Source::Folder => Search { max_disparity: None, min_disparity: None },
        }
    }

    /// Reads its images and what else its range takes, and the cameras for the output `cameras`.
    pub(super) fn read(&self, base: &Path, reader: Reader, cameras: Option<&Also>) -> Result<Input> {
        let at = |path: &String| base.join(path);
        let (pair, range, [left, right], mask) = match &self.source {
            Source::Row(Row { left, right, mask, .. }) => {
                let pair = reader.pair(&at(left), &at(right), mask.as_ref().map(at).as_deref())?;
                (pair, None, [left, right].map(Clone::clone), mask.clone())
            }
            Source::Folder => {
                let dir = at(&self.name);
                let folder = Folder::to_match(&dir)?;
                let (pair, range) = folder.read_pair(reader)?;
                let views = folder.view_names().map(|file| shown(&Path::new(&self.name).join(file)));
                (pair, Some(range), views, None)
            }
        };
        let beside = calibration_beside(&left);
        let (path, search, is_folder) = (at(&beside), self.search(), range.is_some());
        let is_calibrated = cameras.is_some() || search.max_disparity.is_none() && !is_folder;
        let calibration = if is_calibrated { Calibration::beside(&at(&left))? } else { None };
        let known = calibration.as_ref().map(|known| (path.as_path(), known));
        let Found { range, by_matches } = match range {
            Some(range) => Found { range, by_matches: false },
            None => search.range(&pair, known, Sign::default())?,
        };
        let rig = |word| input::rig(word, known, &at(&left), pair.size(), "put one there");
        let rig = cameras.map(rig).transpose()?;
        let calibration = (known.is_some() || is_folder && path.exists()).then_some(beside);
        let files = Files { left, right, mask, calibration, output: None };
        Ok(Input { pair, range, by_matches, rig, files })
    }
}

pub(super) fn shown(path: &Path) -> String {
    path.display().to_string()
}

fn calibration_beside(left: &str) -> String {
    shown(&Path::new(left).with_file_name(CALIBRATION))
}
