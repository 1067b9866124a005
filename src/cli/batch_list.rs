//! The pairs of a batch: rows of a list, or the folders in a folder. A list that makes no sense is refused as a whole.

use std::collections::HashMap;
use std::fmt::Write;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use csv::{ReaderBuilder, StringRecord, Trim};
use mrfgs::image::Pair;
use mrfgs::image::calib::Calibration;
use mrfgs::image::read::Reader;
use mrfgs::options::DisparityRange;
use mrfgs::{Error, Result};

use super::folder::{self, Folder};
use super::search::{self, Largest, Search};
use super::sidecar::Files;
use super::sign::Sign;

/// What the header of a list may name; the first three it must.
const COLUMNS: [&str; 6] = ["name", "left", "right", "max_disparity", "min_disparity", "mask"];
const REQUIRED: usize = 3;

/// The longest name of a pair, in bytes: what file systems allow leaves room for what is added.
const MAX_NAME: usize = 200;

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

/// Where a pair is from; paths as the list has them.
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
            return Err(Error::read(path, reason));
        }
        Ok(list)
    }

    fn of_rows(path: &Path) -> Result<Self> {
        let text = fs::read_to_string(path).map_err(|e| match e.kind() {
            ErrorKind::NotFound => Error::read(path, "there is no such file; check the name"),
            ErrorKind::InvalidData => Error::read(path, "is no text in UTF-8; give a CSV file"),
            _ => Error::read(path, e),
        })?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
        let lines = text.lines().zip(1..).map(|(line, number)| (number, line));
        let mut lines = lines.filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
        let mut pairs = Vec::new();
        let mut names = Names::default();
        if let Some((number, header)) = lines.next() {
            let wrong = |number: usize, reason: String| Error::read(path, format!("line {number}: {reason}"));
            let columns = columns(&fields(header)).map_err(|reason| wrong(number, reason))?;
            for (number, line) in lines {
                let listed = row(&columns, &fields(line)).map_err(|reason| wrong(number, reason))?;
                names.add(&listed.name, number).map_err(|reason| wrong(number, reason))?;
                pairs.push(listed);
            }
        }
        let base = path.parent().unwrap_or(Path::new("")).to_owned();
        Ok(Self { base, pairs })
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
    /// Every file that is there and may be read of it, as the list has it.
    pub(super) fn inputs(&self, base: &Path) -> Vec<String> {
        let inputs = match &self.source {
            Source::Row { left, right, mask, search } => {
                let calibration = search.max_disparity.is_none().then(|| calibration_beside(left));
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

    /// Reads its images and what else its range takes.
    pub(super) fn read(&self, base: &Path, reader: Reader) -> Result<Input> {
        let output = String::new();
        match &self.source {
            Source::Row { left, right, mask, search } => {
                let [left_path, right_path] = [left, right].map(|path| base.join(path));
                let mask_path = mask.as_ref().map(|path| base.join(path));
                let pair = reader.pair(&left_path, &right_path, mask_path.as_deref())?;
                let calibration = match search.max_disparity {
                    None => Calibration::beside(&left_path)?,
                    Some(_) => None,
                };
                let calibration_path = left_path.with_file_name("calib.txt");
                let known = calibration.as_ref().map(|known| (calibration_path.as_path(), known));
                let range = search.range(&pair, known, Sign::default()).map_err(in_columns)?.range;
                let calibration = calibration.map(|_| calibration_beside(left));
                let files = Files {
                    left: left.clone(),
                    right: right.clone(),
                    mask: mask.clone(),
                    calibration,
                    output,
                };
                Ok(Input { pair, range, files })
            }
            Source::Folder => {
                let dir = base.join(&self.name);
                let folder = Folder::to_match(&dir)?;
                let (pair, range) = folder.read_pair(reader)?;
                let inside = |file: &str| shown(&Path::new(&self.name).join(file));
                let [left, right] = folder.view_names().map(inside);
                let calibration = dir.join("calib.txt").exists().then(|| inside("calib.txt"));
                Ok(Input { pair, range, files: Files { left, right, mask: None, calibration, output } })
            }
        }
    }
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

fn calibration_beside(left: &str) -> String {
    shown(&Path::new(left).with_file_name("calib.txt"))
}

/// An error of the range, told by the list's columns rather than by flags.
fn in_columns(error: Error) -> Error {
    match error {
        Error::Option { name, reason } => Error::Option {
            name: name.trim_start_matches("--").replace('-', "_"),
            reason: reason.replace("--min-disparity", "min_disparity"),
        },
        error => error,
    }
}

/// The fields of a line of CSV.
fn fields(line: &str) -> StringRecord {
    let mut reader =
        ReaderBuilder::new().has_headers(false).flexible(true).trim(Trim::All).from_reader(line.as_bytes());
    // A line of UTF-8 in memory always is a record.
    reader.records().next().and_then(std::result::Result::ok).unwrap_or_default()
}

/// Which column each field of the rows belongs to.
fn columns(header: &StringRecord) -> std::result::Result<Vec<&'static str>, String> {
    let known = COLUMNS.join(", ");
    let mut columns = Vec::new();
    for field in header {
        let column = COLUMNS.into_iter().find(|column| *column == field);
        let column = column.ok_or_else(|| {
            format!("`{}` is no column; the header names the columns, of {known}", field.escape_debug())
        })?;
        if columns.contains(&column) {
            return Err(format!("there are two columns {column}; leave one away"));
        }
        columns.push(column);
    }
    match COLUMNS[..REQUIRED].iter().find(|column| !columns.contains(column)) {
        Some(missing) => {
            Err(format!("there is no column {missing}; the header names the columns, of {known}"))
        }
        None => Ok(columns),
    }
}

fn row(columns: &[&str], fields: &StringRecord) -> std::result::Result<Listed, String> {
    if fields.len() != columns.len() {
        let (found, wanted) = (fields.len(), columns.len());
        return Err(format!(
            "there are {found} fields and {wanted} columns; give one each, in double quotes where it has a comma"
        ));
    }
    let field = |name: &str| {
        let place = columns.iter().position(|column| *column == name)?;
        fields.get(place).filter(|field| !field.is_empty())
    };
    let required =
        |name: &str| field(name).map(str::to_owned).ok_or_else(|| format!("the {name} is missing"));
    let within = |column: &str, reason: String| format!("{column}: {reason}");
    let max = field("max_disparity").map(search::pixels_or_auto).transpose();
    let min = field("min_disparity").map(search::pixels).transpose();
    let search = Search {
        max_disparity: max.map_err(|reason| within("max_disparity", reason))?,
        min_disparity: min.map_err(|reason| within("min_disparity", reason))?,
    };
    if let Some(Largest::Pixels(max)) = search.max_disparity {
        let range = DisparityRange::new(search.min_disparity.unwrap_or(0), max);
        range.map_err(|error| in_columns(error).to_string())?;
    }
    let [name, left, right] = ["name", "left", "right"].map(required);
    let mask = field("mask").map(str::to_owned);
    Ok(Listed { name: name?, source: Source::Row { left: left?, right: right?, mask, search } })
}

/// The names so far, in lower case, and the lines that they are from: on some file systems `A` and `a` are one file.
#[derive(Default)]
struct Names(HashMap<String, usize>);

impl Names {
    /// Refuses a name that is taken, or that no file should have.
    fn add(&mut self, name: &str, line: usize) -> std::result::Result<(), String> {
        let allowed = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        let shown = name.escape_debug().take(MAX_NAME).collect::<String>();
        if name.len() > MAX_NAME || name.starts_with(['.', '-']) || !name.chars().all(allowed) {
            return Err(format!(
                "`{shown}` is no name for files; rename it: letters (A to Z), digits, -, _ and ., not - or . first, at most \
                 {MAX_NAME}"
            ));
        }
        let lower = name.to_ascii_lowercase();
        if let Some(ending) = ["-confidence", "-validity"].into_iter().find(|ending| lower.ends_with(ending))
        {
            return Err(format!("`{shown}` ends in {ending}, as maps of other pairs do; rename it"));
        }
        if let Some(other) = self.0.insert(lower, line) {
            let mut reason = format!("the name {shown} is taken");
            if other > 0 {
                let _ = write!(reason, " by line {other}");
            }
            return Err(reason + "; rename one of them, by more than upper and lower case");
        }
        Ok(())
    }
}
