//! The entries of a calibration file, independent of its syntax.

use std::path::Path;

use base64::Engine;
use base64::prelude::BASE64_STANDARD as STANDARD;

use crate::calibration::cameras::Pose;
use crate::calibration::matrix::{Matrix, of_quaternion};
use crate::error::{Error, Result};
use crate::text::quoted;

/// The deepest nesting of entries; calibrations need four levels.
pub(super) const MAX_DEPTH: usize = 16;

/// The most entries of a group; calibrations have dozens.
pub(super) const MAX_ENTRIES: usize = 1000;

/// A value.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Node {
    /// A word, a number, or numbers separated by blanks.
    Scalar(String),
    List(Vec<Node>),
    Map(Vec<(String, Node)>),
}

impl Node {
    /// The value of `key`, with exactly this spelling.
    pub(super) fn get(&self, key: &str) -> Option<&Self> {
        let Self::Map(entries) = self else { return None };
        entries.iter().find(|(name, _)| name == key).map(|(_, node)| node)
    }

    /// All numbers of a scalar, a list, a list of lists or an `opencv-matrix`; `None` if there is anything else.
    fn numbers(&self) -> Option<Vec<f64>> {
        match self {
            Self::Scalar(text) => {
                let number = |word: &str| word.parse().ok().filter(|v: &f64| v.is_finite());
                text.split_whitespace().map(number).collect()
            }
            Self::List(nodes) => {
                nodes.iter().map(Self::numbers).collect::<Option<Vec<_>>>().map(|all| all.concat())
            }
            Self::Map(_) => {
                let data = self.get("data")?;
                let data = data.numbers().or_else(|| data.packed())?;
                let count = |key: &str| self.get(key).map(Self::numbers);
                let (rows, columns) = (count("rows"), count("cols"));
                match (rows, columns) {
                    (None, None) => Some(data),
                    (Some(rows), Some(columns)) => {
                        let wanted = rows?.first()? * columns?.first()?;
                        (data.len() == wanted as usize).then_some(data)
                    }
                    _ => None,
                }
            }
        }
    }

    /// Numbers of a matrix in OpenCV's base64, after 24 bytes that state their type, such as `1d`.
    fn packed(&self) -> Option<Vec<f64>> {
        let Self::Scalar(text) = self else { return None };
        let text: String = text.trim_start_matches("$base64$").split_whitespace().collect();
        let bytes = STANDARD.decode(text).ok()?;
        let (head, data) = bytes.split_at_checked(24)?;
        match std::str::from_utf8(head).ok()?.trim().trim_start_matches(|c: char| c.is_ascii_digit()) {
            "d" => unpacked(data, f64::from_le_bytes),
            "f" => unpacked(data, |bytes| f64::from(f32::from_le_bytes(bytes))),
            "i" => unpacked(data, |bytes| f64::from(i32::from_le_bytes(bytes))),
            _ => None,
        }
    }

    fn described(&self) -> String {
        match (self, self.numbers()) {
            (Self::Scalar(text), _) if text.is_empty() => "nothing".into(),
            (Self::Scalar(text), _) => quoted(text),
            (_, Some(numbers)) => match numbers.len() {
                1 => "1 number".into(),
                count => format!("{count} numbers"),
            },
            (Self::List(_), None) => "a list that holds more than numbers".into(),
            (Self::Map(_), None) if self.get("data").is_some() => "a damaged matrix".into(),
            (Self::Map(_), None) => "a group of entries".into(),
        }
    }
}

/// A name in lower case, without separators.
fn plain(name: &str) -> String {
    name.chars().filter(|c| !['_', '-', ' '].contains(c)).collect::<String>().to_lowercase()
}

fn unpacked<const N: usize>(data: &[u8], number: impl Fn([u8; N]) -> f64) -> Option<Vec<f64>> {
    let numbers = data.chunks(N).map(|bytes| bytes.try_into().ok().map(&number).filter(|v| v.is_finite()));
    numbers.collect()
}

/// The entries of one file, or of several that belong together.
pub(super) struct Entries<'a> {
    files: Vec<(&'a Path, &'a Node)>,
    /// The name of their group, with a dot: `cam0.`.
    group: String,
}

/// A value with its name.
pub(super) struct Entry<'a> {
    path: &'a Path,
    name: String,
    node: &'a Node,
}

impl<'a> Entries<'a> {
    pub(super) fn new(files: Vec<(&'a Path, &'a Node)>) -> Self {
        Self { files, group: String::new() }
    }

    /// The entries of all these files.
    pub(super) fn together(files: &[Self]) -> Self {
        Self::new(files.iter().flat_map(|entries| entries.files.iter().copied()).collect())
    }

    /// The first entry with one of `names`: words in lower case, without `_` and `-`.
    pub(super) fn find(&self, names: &str) -> Option<Entry<'a>> {
        self.find_all(names).next()
    }

    /// All entries with one of `names`; see [`Entries::find`].
    pub(super) fn find_all(&self, names: &str) -> impl Iterator<Item = Entry<'a>> {
        let is_one = move |name: &str| names.split(' ').any(|known| known == plain(name));
        self.each().filter(move |(_, name, _)| is_one(name)).map(|(path, name, node)| Entry {
            path,
            name: format!("{}{name}", self.group),
            node,
        })
    }

    /// The names of all entries, in lower case, without `_` and `-`.
    pub(super) fn names(&self) -> impl Iterator<Item = String> {
        self.each().map(|(_, name, _)| plain(name))
    }

    fn each(&self) -> impl Iterator<Item = (&'a Path, &'a str, &'a Node)> {
        self.files.iter().flat_map(|&(path, node)| {
            let entries = if let Node::Map(entries) = node { entries.as_slice() } else { &[] };
            entries.iter().map(move |(name, node)| (path, name.as_str(), node))
        })
    }

    /// An error if entries with these `names`, which are synonyms, have different values.
    pub(super) fn agree(&self, names: &str) -> Result<()> {
        let mut all = self.find_all(names);
        let Some(first) = all.next() else { return Ok(()) };
        match all.find(|other| !first.says(other)) {
            None => Ok(()),
            Some(other) => {
                let place = if first.path == other.path {
                    String::new()
                } else {
                    format!(" in {}", first.path.display())
                };
                let reason = format_args!("contradicts {}{place}; keep the one that is right", first.name);
                Err(other.error(reason))
            }
        }
    }

    /// Like [`Entries::find`]; if it is missing, an error names it `called` and says what was `expected`.
    pub(super) fn require(&self, names: &str, called: &str, expected: &str) -> Result<Entry<'a>> {
        self.find(names).ok_or_else(|| {
            Error::read(self.path(), format!("{}{called} is missing: expected {expected}", self.group))
        })
    }

    /// The number in an entry; see [`Entries::require`].
    pub(super) fn number(&self, names: &str, called: &str) -> Result<f64> {
        self.require(names, called, "a number")?.number()
    }

    /// Like [`Entries::number`]; 0 if there is none.
    pub(super) fn number_or_zero(&self, names: &str) -> Result<f64> {
        self.find(names).map_or(Ok(0.0), |entry| entry.number())
    }

    /// Like [`Entries::number`], for a number above 0.
    pub(super) fn above_0(&self, names: &str, called: &str) -> Result<f64> {
        let entry = self.require(names, called, "a number above 0")?;
        entry.number().ok().filter(|v| *v > 0.0).ok_or_else(|| entry.wrong("a number above 0"))
    }

    /// The file to name in errors about all entries together.
    pub(super) fn path(&self) -> &'a Path {
        self.files[0].0
    }
}

impl<'a> Entry<'a> {
    pub(super) fn wrong(&self, expected: &str) -> Error {
        let found = self.node.described();
        Error::read(self.path, format!("{}: expected {expected}, found {found}", self.name))
    }

    /// An error about this entry.
    pub(super) fn error(&self, reason: impl std::fmt::Display) -> Error {
        Error::read(self.path, format!("{}: {reason}", self.name))
    }

    /// The name of the entry, as the file spells it.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// Whether another entry has the same value. Numbers are compared only if their counts agree.
    fn says(&self, other: &Self) -> bool {
        match (self.node.numbers(), other.node.numbers()) {
            (Some(one), Some(two)) => one.len() != two.len() || one == two,
            _ => self.node == other.node,
        }
    }

    /// Whether it looks like a camera matrix, even a damaged one: an OpenCV matrix of any size, or 9 or 12 numbers.
    pub(super) fn is_matrix(&self) -> bool {
        self.node.get("data").is_some()
            || self.node.numbers().is_some_and(|numbers| matches!(numbers.len(), 9 | 12))
    }

    /// Whether it is a list or a group.
    pub(super) fn is_compound(&self) -> bool {
        !matches!(self.node, Node::Scalar(_))
    }

    /// The entries of a group.
    pub(super) fn group(&self) -> Result<Entries<'a>> {
        match self.node {
            Node::Map(_) => {
                Ok(Entries { files: vec![(self.path, self.node)], group: format!("{}.", self.name) })
            }
            _ => Err(self.wrong("a group of entries")),
        }
    }

    /// Exactly `N` numbers; `expected` describes them in errors.
    pub(super) fn numbers<const N: usize>(&self, expected: &str) -> Result<[f64; N]> {
        let numbers = self.node.numbers().and_then(|numbers| numbers.try_into().ok());
        numbers.ok_or_else(|| self.wrong(expected))
    }

    /// Any number of numbers; `expected` describes them in errors.
    pub(super) fn list(&self, expected: &str) -> Result<Vec<f64>> {
        self.node.numbers().ok_or_else(|| self.wrong(expected))
    }

    /// A matrix of `R` rows and `C` columns, row by row.
    pub(super) fn matrix<const R: usize, const C: usize>(&self) -> Result<[[f64; C]; R]> {
        let expected = format!("{} numbers, a matrix of {R} x {C}", R * C);
        let numbers = self.list(&expected)?;
        if numbers.len() != R * C {
            return Err(self.wrong(&expected));
        }
        Ok(std::array::from_fn(|y| std::array::from_fn(|x| numbers[y * C + x])))
    }

    /// The rotation that `matrix`, the value of this entry, stands for.
    pub(super) fn rotation(&self, matrix: &Matrix) -> Result<Matrix> {
        let wrong = || self.wrong("a rotation, whose rows are at right angles and of length 1");
        super::matrix::nearest_rotation(matrix).ok_or_else(wrong)
    }

    /// A rotation and a translation, as a matrix of 4 x 4.
    pub(super) fn pose(&self) -> Result<Pose> {
        let [a, b, c, [0.0, 0.0, 0.0, 1.0]] = self.matrix::<4, 4>()? else {
            return Err(self.wrong("a rotation and a translation, and 0 0 0 1 in the last row"));
        };
        let rotation = self.rotation(&[a, b, c].map(|row| [row[0], row[1], row[2]]))?;
        Ok(Pose { rotation, translation: [a[3], b[3], c[3]] })
    }

    /// The rotation of a quaternion, w first.
    pub(super) fn quaternion(&self, wxyz: [f64; 4]) -> Result<Matrix> {
        of_quaternion(wxyz).ok_or_else(|| self.wrong("a rotation as a quaternion of length 1"))
    }

    /// The members of a list.
    pub(super) fn items(&self) -> Result<Vec<Self>> {
        let Node::List(nodes) = self.node else { return Err(self.wrong("a list")) };
        let item = |(i, node)| Self { path: self.path, name: format!("{}[{i}]", self.name), node };
        Ok(nodes.iter().enumerate().map(item).collect())
    }

    /// A number.
    pub(super) fn number(&self) -> Result<f64> {
        self.numbers("a number").map(|[number]| number)
    }

    /// A number of pixels.
    pub(super) fn count(&self) -> Result<usize> {
        const EXPECTED: &str = "a whole number of pixels above 0";
        let [number] = self.numbers(EXPECTED)?;
        pixels(number).ok_or_else(|| self.wrong(EXPECTED))
    }

    /// Width and height.
    pub(super) fn size(&self) -> Result<(usize, usize)> {
        const EXPECTED: &str = "width and height, two whole numbers above 0";
        let [width, height] = self.numbers(EXPECTED)?;
        pixels(width).zip(pixels(height)).ok_or_else(|| self.wrong(EXPECTED))
    }

    /// A word.
    pub(super) fn word(&self) -> Result<&'a str> {
        match self.node {
            Node::Scalar(text) => Ok(text.trim_matches(|c: char| c == '"' || c.is_whitespace())),
            _ => Err(self.wrong("a word")),
        }
    }
}

fn pixels(number: f64) -> Option<usize> {
    (number.fract() == 0.0 && (1.0..=f64::from(1 << 24)).contains(&number)).then_some(number as usize)
}
