//! Lists of pairs: CSV files in UTF-8 whose header names the columns.
//!
//! Columns are name, left and right, and optionally `max_disparity`, `min_disparity`, mask, calibration, prior, `prior_sigma`,
//! `prior_kind`, `prior_unit` and `prior_pose`. An empty field counts as missing. Empty lines and lines starting with # are skipped.

use std::collections::HashMap;
use std::fmt::Write;
use std::path::Path;

use clap::ValueEnum;
use csv::{ReaderBuilder, StringRecord, Trim};
use mrfgs::low_level::text::{self, quoted};
use mrfgs::options::DisparityRange;
use mrfgs::{Error, Result};
use serde::Serialize;

use crate::args::above_zero;
pub use crate::args::search::{Largest, pixels};
pub use crate::args::{LengthUnit, PriorKind};
use crate::outputs::also;
use crate::remedy;

/// The columns of a list; the first three are required.
pub(crate) const COLUMNS: [&str; 12] = [
    "name",
    "left",
    "right",
    "max_disparity",
    "min_disparity",
    "mask",
    "calibration",
    "prior",
    "prior_sigma",
    "prior_kind",
    "prior_unit",
    "prior_pose",
];
/// The remedy of messages about a list without a header.
const HEADER: &str = "begin the list with a header such as name,left,right";
/// Columns that say how to use a prior.
const OF_PRIOR: [&str; 4] = ["prior_sigma", "prior_kind", "prior_unit", "prior_pose"];
const REQUIRED: usize = 3;

/// The longest name of a pair in bytes, short enough to leave room for the endings of its files.
const MAX_NAME: usize = 200;
/// Enough for a list of a million pairs.
const MAX_BYTES: u64 = 1 << 28;

/// One pair of a list.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The name of its outputs; see [`Names`].
    pub name: String,
    /// Path of the left image, as written in the list.
    pub left: String,
    /// Path of the right image; `None` if the left file holds both views.
    pub right: Option<String>,
    /// Path of the mask, if there is one.
    pub mask: Option<String>,
    /// Paths of the calibration files; empty if the list has none.
    pub calibration: Vec<String>,
    /// Largest disparity to search, if given.
    pub max_disparity: Option<Largest>,
    /// Smallest disparity to search, in pixels, if given; at most the largest.
    pub min_disparity: Option<i32>,
    /// The known disparities of the left view, if the row names a file with them.
    pub prior: Option<PriorRow>,
}

/// A file of known disparities of the left view, and how to use it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PriorRow {
    /// Path of the file, as written in the list.
    #[serde(skip)]
    pub file: String,
    /// Standard deviation in pixels, if given; above 0.
    #[serde(rename = "prior_sigma")]
    pub sigma: Option<f64>,
    /// Whether the known disparities count as points or as a surface, if the row says so.
    #[serde(rename = "prior_kind")]
    pub kind: Option<PriorKind>,
    /// The unit of lengths in the file, if given.
    #[serde(rename = "prior_unit")]
    pub unit: Option<LengthUnit>,
    /// Path of the file with the pose of its points, as written in the list, if given.
    #[serde(skip)]
    pub pose: Option<String>,
}

impl Row {
    /// A pair of these images; without a right one, the left file holds both views.
    pub(crate) fn of_views(
        name: String,
        left: String,
        right: Option<String>,
        calibration: Vec<String>,
    ) -> Self {
        Self {
            name,
            left,
            right,
            mask: None,
            calibration,
            max_disparity: None,
            min_disparity: None,
            prior: None,
        }
    }
}

/// Reads a list, which may have no rows.
///
/// # Errors
/// [`Error::Read`], with the line number if the fault is in a line.
pub fn read(path: &Path) -> Result<Vec<Row>> {
    let text = String::from_utf8(text::read(path, MAX_BYTES, "list of pairs")?)
        .map_err(|_| Error::read(path, "is not UTF-8 text; give a CSV file"))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let lines = text.lines().zip(1..).map(|(line, number)| (number, line));
    let mut lines = lines.filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
    let Some((number, header)) = lines.next() else { return Ok(Vec::new()) };
    let wrong = |number: usize, reason: String| Error::read(path, format!("line {number}: {reason}"));
    let columns = columns(&fields(header)).map_err(|reason| wrong(number, reason))?;
    let mut names = Names::default();
    let mut rows = Vec::new();
    for (number, line) in lines {
        let row = row(&columns, &fields(line)).map_err(|reason| wrong(number, reason))?;
        names.add(&row.name, number).map_err(|reason| wrong(number, reason))?;
        rows.push(row);
    }
    Ok(rows)
}

/// The fields of a CSV line.
fn fields(line: &str) -> StringRecord {
    let mut reader =
        ReaderBuilder::new().has_headers(false).flexible(true).trim(Trim::All).from_reader(line.as_bytes());
    // A line of UTF-8 in memory is always a record.
    reader.records().next().and_then(std::result::Result::ok).unwrap_or_default()
}

/// The column that each field of a row belongs to.
fn columns(header: &StringRecord) -> std::result::Result<Vec<&'static str>, String> {
    let known = COLUMNS.join(", ");
    let mut columns = Vec::new();
    for field in header {
        let column = COLUMNS.into_iter().find(|column| *column == field);
        let column = column
            .ok_or_else(|| format!("unknown column {}; {HEADER}; it may name {known}", quoted(field)))?;
        if columns.contains(&column) {
            return Err(format!("the column {column} appears twice; remove one"));
        }
        columns.push(column);
    }
    match COLUMNS[..REQUIRED].iter().find(|column| !columns.contains(column)) {
        Some(missing) => Err(format!("the column {missing} is missing; add it: the header may name {known}")),
        None => Ok(columns),
    }
}

/// Whether a file holds both views, according to its extension.
pub(crate) fn holds_both(file: &Path) -> bool {
    let extension = file.extension().unwrap_or_default();
    ["mpo", "jps"].iter().any(|both| extension.eq_ignore_ascii_case(both))
}

fn row(columns: &[&str], fields: &StringRecord) -> std::result::Result<Row, String> {
    if fields.len() != columns.len() {
        let (found, wanted) = (fields.len(), columns.len());
        return Err(format!(
            "there are {found} fields but {wanted} columns; put fields with a comma in double quotes"
        ));
    }
    let field = |name: &str| {
        let place = columns.iter().position(|column| *column == name)?;
        fields.get(place).filter(|field| !field.is_empty())
    };
    let required =
        |name: &str| field(name).map(str::to_owned).ok_or_else(|| format!("the {name} is missing"));
    let within = |column: &str, reason: String| format!("{column}: {reason}");
    let max = field("max_disparity").map(str::parse).transpose();
    let min = field("min_disparity").map(pixels).transpose();
    let prior = match field("prior") {
        Some(file) => {
            let sigma = field("prior_sigma").map(sigma).transpose();
            let kind = field("prior_kind").map(|kind| PriorKind::from_str(kind, false)).transpose();
            let unit = field("prior_unit").map(|unit| LengthUnit::from_str(unit, false)).transpose();
            Some(PriorRow {
                file: file.to_owned(),
                sigma: sigma.map_err(|reason| within("prior_sigma", reason))?,
                kind: kind.map_err(|_| within("prior_kind", "must be points or surface".to_owned()))?,
                unit: unit.map_err(|_| within("prior_unit", "must be mm, cm or m".to_owned()))?,
                pose: field("prior_pose").map(str::to_owned),
            })
        }
        None => match OF_PRIOR.into_iter().find(|column| field(column).is_some()) {
            Some(column) => {
                return Err(within(column, "there is no prior; fill that column, too".to_owned()));
            }
            None => None,
        },
    };
    let files = field("calibration").into_iter().flat_map(|files| files.split(';'));
    let row = Row {
        name: required("name")?,
        left: required("left")?,
        right: match field("left") {
            Some(left) if holds_both(Path::new(left)) => field("right").map(str::to_owned),
            _ => Some(required("right")?),
        },
        mask: field("mask").map(str::to_owned),
        calibration: files.map(|file| file.trim().to_owned()).filter(|file| !file.is_empty()).collect(),
        max_disparity: max.map_err(|reason| within("max_disparity", reason))?,
        min_disparity: min.map_err(|reason| within("min_disparity", reason))?,
        prior,
    };
    if let Some(Largest::Pixels(max)) = row.max_disparity {
        let range = DisparityRange::new(row.min_disparity.unwrap_or(0), max);
        range.map_err(|error| remedy::error(&error, &remedy::COLUMNS))?;
    }
    Ok(row)
}

/// A standard deviation in pixels.
fn sigma(field: &str) -> std::result::Result<f64, String> {
    above_zero(field).ok_or_else(|| format!("{} is not a number above 0", quoted(field)))
}

/// The names of pairs so far, each valid as a file name on every file system: without / \ : * ? " < > | and control characters, no leading
/// . or -, no trailing . or space, and no ending that `mrfgs batch` adds to further outputs (.confidence and so on). Names must differ by
/// more than case, as some file systems ignore it.
#[derive(Debug, Default)]
pub struct Names(HashMap<String, usize>);

impl Names {
    /// Adds a name from line `line` (from 1; 0 if there are no lines).
    ///
    /// # Errors
    /// The problem and the remedy, for a name that is taken or unfit for a file.
    pub fn add(&mut self, name: &str, line: usize) -> std::result::Result<(), String> {
        let forbidden = |c: char| c.is_control() || r#"/\:*?"<>|"#.contains(c);
        let ends_badly = name.starts_with(['.', '-', ' ']) || name.ends_with(['.', ' ']);
        if name.len() > MAX_NAME || ends_badly || name.contains(forbidden) {
            return Err(format!(
                r#"{} cannot be a file name; rename it: at most {MAX_NAME} bytes, none of / \ : * ? " < > |, no leading . or -, no trailing . or space"#,
                quoted(name)
            ));
        }
        let lower = name.to_lowercase();
        if let Some(ending) = also::endings().find(|ending| lower.ends_with(ending)) {
            return Err(format!("`{name}` ends in {ending}, which is reserved for outputs; rename it"));
        }
        if let Some(other) = self.0.insert(lower, line) {
            let mut reason = format!("the name {name} is taken");
            if other > 0 {
                let _ = write!(reason, " by line {other}");
            }
            return Err(reason + "; rename one of them (case does not count)");
        }
        Ok(())
    }
}
