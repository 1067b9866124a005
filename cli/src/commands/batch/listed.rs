//! The pairs of a batch: rows of a list, or the folders in a folder. A list with a mistake is refused as a whole.

use std::fs;
use std::path::{Path, PathBuf};

use mrfgs::Error;
use mrfgs::depth::Rig;
use mrfgs::image::Pair;
use mrfgs::image::calib::Calibration;
use mrfgs::image::read::Reader;
use mrfgs::options::DisparityRange;

use crate::args::search::{Found, Search};
use crate::args::sign::Sign;
use crate::failure::Result;
use crate::outputs::also::Also;
use crate::outputs::record::Files;
use crate::pairs::cameras;
use crate::pairs::folder::{self, CALIBRATION, Folder};
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
    Row {
        left: String,
        right: String,
        mask: Option<String>,
        search: Search,
    },
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
        let pairs = rows.map(|Row { name, left, right, mask, max_disparity, min_disparity }| {
            let search = Search { max_disparity, min_disparity };
            Listed { name, source: Source::Row { left, right, mask, search } }
        });
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
            Source::Row { left, right, mask, search } => {
                let calibrated = cameras || search.max_disparity.is_none();
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
            Source::Row { search, .. } => *search,
            Source::Folder => Search { max_disparity: None, min_disparity: None },
        }
    }

    /// Reads its images and what else its range takes, and the cameras for the output `cameras`.
    pub(super) fn read(&self, base: &Path, reader: Reader, cameras: Option<&Also>) -> Result<Input> {
        let rig = |pair: &Pair, left: &Path, calibration: Option<(&Path, &Calibration)>| {
            let rig = |word| cameras::rig(word, calibration, left, pair.size(), "put one there");
            cameras.map(rig).transpose()
        };
        match &self.source {
            Source::Row { left, right, mask, search } => {
                let [left_path, right_path] = [left, right].map(|path| base.join(path));
                let mask_path = mask.as_ref().map(|path| base.join(path));
                let pair = reader.pair(&left_path, &right_path, mask_path.as_deref())?;
                let calibration = match search.max_disparity {
                    Some(_) if cameras.is_none() => None,
                    _ => Calibration::beside(&left_path)?,
                };
                let calibration_path = left_path.with_file_name(CALIBRATION);
                let known = calibration.as_ref().map(|known| (calibration_path.as_path(), known));
                let found = search.range(&pair, known, Sign::default())?;
                let Found { range, by_matches } = found;
                let rig = rig(&pair, &left_path, known)?;
                let calibration = known.map(|_| calibration_beside(left));
                let [left, right] = [left, right].map(Clone::clone);
                let files = Files { left, right, mask: mask.clone(), calibration, output: None };
                Ok(Input { pair, range, by_matches, rig, files })
            }
            Source::Folder => {
                let dir = base.join(&self.name);
                let folder = Folder::to_match(&dir)?;
                let (pair, range) = folder.read_pair(reader)?;
                let [left_path, _] = folder.view_names().map(|file| dir.join(file));
                let calibration_path = dir.join(CALIBRATION);
                let calibration = cameras.map(|_| Calibration::beside(&left_path)).transpose()?.flatten();
                let known = calibration.as_ref().map(|known| (calibration_path.as_path(), known));
                let rig = rig(&pair, &left_path, known)?;
                let inside = |file: &str| shown(&Path::new(&self.name).join(file));
                let [left, right] = folder.view_names().map(inside);
                let calibration = calibration_path.exists().then(|| inside(CALIBRATION));
                let files = Files { left, right, mask: None, calibration, output: None };
                Ok(Input { pair, range, by_matches: false, rig, files })
            }
        }
    }
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

fn calibration_beside(left: &str) -> String {
    shown(&Path::new(left).with_file_name(CALIBRATION))
}
