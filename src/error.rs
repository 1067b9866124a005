//! The errors of the library, as types.
//!
//! Each error says in plain words what is wrong, with its names and numbers. The remedy is often a flag or an
//! argument of a front end, which this library does not know: a front end matches on the cause and adds its
//! own words.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Any error of the library.
///
/// [`Error::Option`], [`Error::Preset`], [`Error::Range`], [`Error::Execution`] and [`Error::Budget`] are wrong
/// requests; [`Error::Device`] and [`Error::Memory`] are limits of the machine; the others are about data.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be read, or is not what its name says.
    #[error("cannot read {}: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        cause: ReadError,
    },
    /// A file could not be written; nothing of it is left behind.
    #[error("cannot write {}: {reason}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The reason.
        #[source]
        reason: Reason,
    },
    /// A key of a [`Method`](crate::options::Method) has a value that makes no sense, or does not exist.
    #[error("{key}: {cause}")]
    Option {
        /// The key, such as `levels`.
        key: String,
        /// The cause.
        #[source]
        cause: OptionError,
    },
    /// There is no preset of this name.
    #[error("there is no preset `{name}`; the presets are {}", known.join(", "))]
    Preset {
        /// The name that was asked for.
        name: String,
        /// The names of the presets.
        known: Vec<&'static str>,
    },
    /// The range of disparities makes no sense, or none can be found.
    #[error("disparity range: {0}")]
    Range(#[from] RangeError),
    /// The device or the threads that were asked for are invalid or do not exist.
    #[error(transparent)]
    Execution(#[from] ExecutionError),
    /// The memory that the method grants to a match is too small.
    #[error(transparent)]
    Budget(#[from] BudgetError),
    /// A calibration lacks a value that depth needs, or makes no sense.
    #[error("the calibration {0}")]
    Calibration(String),
    /// The pair cannot be rectified by its own matches.
    #[error("the pair cannot be rectified without a calibration: {0}")]
    Rectification(#[from] RectificationError),
    /// Images, masks, maps or regions do not fit together.
    #[error("{0}")]
    Mismatch(String),
    /// There is no device, or the device failed.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The machine or the device has too little memory.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// The caller asked to stop.
    #[error("interrupted")]
    Interrupted,
}

/// Why a file cannot be read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// Its header claims more pixels than the reader's limit.
    #[error("claims {width} x {height} pixels, but at most {limit} are read")]
    TooManyPixels {
        /// Columns.
        width: u64,
        /// Rows.
        height: u64,
        /// Most pixels that are read.
        limit: u64,
    },
    /// It is larger than any image within the reader's limit.
    #[error("is larger than any image of {limit} pixels, the limit")]
    TooManyBytes {
        /// Most pixels that are read.
        limit: u64,
    },
    /// A disparity map was read from whole numbers, whose scale is unknown.
    #[error(
        "holds whole numbers, and their scale is unknown; disparity maps are .pfm, float .tif or .npy, or \
         16-bit .png with disparity times 256"
    )]
    UnknownScale,
    /// A scale was given for a disparity map of floats.
    #[error("holds disparities in pixels; only whole numbers need a scale")]
    NeedlessScale,
    /// The file's no-data value is not a number.
    #[error("has the no-data value {value}, which is not a number")]
    NoData {
        /// The value in the file.
        value: String,
    },
    /// There is not enough memory to read it.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// It is a file of options, and one of them is invalid.
    #[error("{}{key}: {cause}", line.map_or(String::new(), |line| format!("line {line}: ")))]
    Option {
        /// The line, from 1, where it is known.
        line: Option<usize>,
        /// The key.
        key: String,
        /// The cause.
        cause: OptionError,
    },
    /// Any other cause, with the remedy if there is one.
    #[error(transparent)]
    Other(Reason),
}

/// The cause of an error in words; its [source](std::error::Error::source) is the error of the system, if there is one.
#[derive(Clone, Debug)]
pub struct Reason {
    text: String,
    io: Option<Arc<io::Error>>,
    of_request: bool,
}

impl Reason {
    /// Describes an error of the system in other words.
    pub fn from_io(error: io::Error, words: impl Into<String>) -> Self {
        Self { text: words.into(), io: Some(error.into()), of_request: false }
    }

    /// The request cannot be served on any machine, such as a name whose extension is no format.
    pub fn of_request(words: impl Into<String>) -> Self {
        Self { of_request: true, ..words.into().into() }
    }

    /// Whether the request itself makes no sense.
    #[must_use]
    pub fn is_of_request(&self) -> bool {
        self.of_request
    }

    /// Replaces the text by `f` of it.
    #[must_use]
    pub fn reworded(self, f: impl FnOnce(&str) -> String) -> Self {
        Self { text: f(&self.text), ..self }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl std::error::Error for Reason {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.io.as_deref().map(|error| error as _)
    }
}

/// Compares the texts.
impl PartialEq for Reason {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

impl From<String> for Reason {
    fn from(text: String) -> Self {
        Self { text, io: None, of_request: false }
    }
}

impl From<&str> for Reason {
    fn from(text: &str) -> Self {
        text.to_owned().into()
    }
}

impl From<io::Error> for Reason {
    fn from(error: io::Error) -> Self {
        let text = in_words(&error);
        Self::from_io(error, text)
    }
}

/// The text of a system error for users: without its number and without Rust's names for kinds of errors.
#[must_use]
pub fn in_words(error: &io::Error) -> String {
    let text = error.to_string();
    if let Some(code) = error.raw_os_error() {
        return text.strip_suffix(&format!(" (os error {code})")).unwrap_or(&text).to_owned();
    }
    match error.kind() {
        _ if error.get_ref().is_some() => text,
        io::ErrorKind::UnexpectedEof => "it ends too early".into(),
        io::ErrorKind::NotFound => "it is not there".into(),
        io::ErrorKind::WriteZero => "no more can be written".into(),
        _ => text,
    }
}

impl<T: Into<Reason>> From<T> for ReadError {
    fn from(reason: T) -> Self {
        Self::Other(reason.into())
    }
}

/// An error in a key of a [`Method`](crate::options::Method).
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OptionError {
    /// There is no such key.
    #[error("there is no such key")]
    Unknown,
    /// The key belongs to another group.
    #[error("there is no such key; it is `{key}`")]
    InGroup {
        /// The key with its own group: `cost.sad-window`.
        key: String,
    },
    /// It is a group of keys.
    #[error("is a group and takes no value; set one of its keys: {}", keys.join(", "))]
    IsGroup {
        /// The keys of the group.
        keys: Vec<String>,
    },
    /// A file sets the key twice.
    #[error("is set in line {line} already; keep one of the two")]
    Repeated {
        /// The line that sets it first.
        line: usize,
    },
    /// The value is of the wrong kind.
    #[error("expected {expected}, not {found}")]
    WrongKind {
        /// The values that the key takes: `levels, 1 to 16`.
        expected: String,
        /// The value that was given.
        found: String,
    },
    /// The value is outside its range.
    #[error("{value} is outside {low} to {high}")]
    OutOfRange {
        /// The value that was given.
        value: f64,
        /// The smallest value.
        low: f64,
        /// The largest value.
        high: f64,
    },
    /// The value must be odd.
    #[error("{value} is not odd; take {} or {}", value.saturating_sub(1), value + 1)]
    NotOdd {
        /// The value that was given.
        value: u32,
    },
}

/// An error in a range of disparities; all numbers are in pixels.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RangeError {
    /// The largest disparity is below the smallest.
    #[error("{max} is below the minimum disparity {min}")]
    Empty {
        /// The smallest disparity.
        min: i32,
        /// The largest disparity.
        max: i32,
    },
    /// A disparity is too far from 0.
    #[error("{disparity} is too far from 0: disparities are within {limit} px of it")]
    TooFar {
        /// The disparity.
        disparity: i32,
        /// The largest absolute disparity.
        limit: i32,
    },
    /// The range has too many labels.
    #[error("{min} to {max} are {} disparities, but at most {limit} can be searched", i64::from(*max) - i64::from(*min) + 1)]
    TooManyLabels {
        /// The smallest disparity.
        min: i32,
        /// The largest disparity.
        max: i32,
        /// Most labels of a range.
        limit: usize,
    },
    /// Every disparity of the range leads outside the images.
    #[error("images {width} pixels wide have no matches at disparities from {min} to {max}")]
    OutsideImages {
        /// The smallest disparity.
        min: i32,
        /// The largest disparity.
        max: i32,
        /// The width of the images.
        width: usize,
    },
    /// No range was given, and the sparse matches are too few to find it. After rectification by its own matches, the pair has enough.
    #[error("no range of disparities found: the pair is not rectified, so matches are not on the same rows")]
    NotRectified,
    /// No range was given, and the sparse matches are too few to find it.
    #[error("no range of disparities found: {}", cause.as_deref().unwrap_or("the two images have too few matches"))]
    NotFound {
        /// The reason, with its remedy, where the pair itself is at fault.
        cause: Option<String>,
    },
}

/// Why a pair cannot be rectified by its own matches.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RectificationError {
    /// Too few matches agree on the pose of the cameras.
    #[error(
        "only {agreeing} of {matches} matches agree on how the camera moved, but at least {least} and half of all must"
    )]
    Few {
        /// Matches that agree.
        agreeing: usize,
        /// All matches.
        matches: usize,
        /// Fewest that are needed.
        least: usize,
    },
    /// All matches fit one plane, or a camera that only rotated.
    #[error("the images show no depth: they show one flat surface, or the camera only turned")]
    Flat,
    /// The camera moved forward or backward.
    #[error("the camera moved forward or back instead of to the side")]
    Forward,
}

/// An error in an [`Execution`](crate::options::Execution).
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExecutionError {
    /// No device has this name or index.
    #[error("no device is called `{wanted}`; the devices are {}", present.join(", "))]
    NoSuchDevice {
        /// The name or index that was asked for.
        wanted: String,
        /// The devices, each as `index: name`.
        present: Vec<String>,
    },
    /// The number of threads is outside its limits.
    #[error("{wanted} threads are not possible; give 1 to {most}")]
    ThreadCount {
        /// How many were asked for.
        wanted: usize,
        /// The largest number.
        most: usize,
    },
    /// The system refuses to start the threads.
    #[error("the threads cannot be started: {0}")]
    Threads(String),
    /// When this process was forked, another thread of the parent was using the object.
    #[error(
        "another thread was using this object when the process was forked, so it is of no use here: make a new one"
    )]
    Forked,
}

/// The memory that a method grants is too little; all sizes are in MiB.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BudgetError {
    /// Even the smallest tiles need more.
    #[error(
        "{memory} MiB of memory is too little for {width} x {height} pixels and {labels} disparities: the smallest tiles need \
         {needed} MiB"
    )]
    NoTileFits {
        /// The memory that is granted.
        memory: u32,
        /// Columns of the image.
        width: usize,
        /// Rows of the image.
        height: usize,
        /// Labels of the range.
        labels: usize,
        /// The least memory that suffices.
        needed: u64,
    },
    /// The steps of a match are inspected, and the memory does not hold all its volumes.
    #[error("to show the steps of a match, all of it must be in memory at once: that needs {needed} MiB")]
    Steps {
        /// The memory that suffices.
        needed: u64,
    },
}

/// Why a device cannot run a match.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DeviceError {
    /// The machine has no driver for any device.
    #[cfg_attr(not(target_arch = "wasm32"), error("no Vulkan or Metal driver found"))]
    #[cfg_attr(target_arch = "wasm32", error("this browser shows no GPU"))]
    NoDriver,
    /// The process was forked from one that had used the drivers, which makes them unusable.
    #[error(
        "no device can be opened in this process, which was forked from one that has opened or looked for devices"
    )]
    Forked,
    /// The device gives wrong maps for a small test pair.
    #[error("{name} fails the self-test: its maps differ from those of the CPU")]
    WrongMaps {
        /// The device.
        name: String,
    },
    /// The match needs more iterations of a loop than is safe with a driver.
    #[error(
        "{width} x {height} pixels and {labels} disparities with {neighbours} neighbours are too many for one invocation of \
         the shader `{shader}`"
    )]
    TooLargeForShader {
        /// Columns of the image.
        width: usize,
        /// Rows of the image.
        height: usize,
        /// Labels of the range.
        labels: usize,
        /// Neighbours in each dependency factor.
        neighbours: usize,
        /// The shader.
        shader: &'static str,
    },
    /// The device or its driver failed, or was lost.
    #[error("{name}: {reason}")]
    Failed {
        /// The device.
        name: String,
        /// The message of its driver, in one line.
        reason: String,
    },
}

/// Why there is not enough memory; all sizes are in bytes.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MemoryError {
    /// The machine has too little memory, or denies it to this process.
    #[error(
        "{} of memory are needed, but {}",
        size(*needed),
        available.map_or("the system refuses them".into(), |free| format!("{} are free", size(free)))
    )]
    Machine {
        /// Bytes that are needed.
        needed: u64,
        /// Bytes that are free, if the system tells.
        available: Option<u64>,
        /// The purpose of the memory.
        purpose: Purpose,
    },
    /// The device has too little memory for the match.
    #[error("the match needs {} of memory, but {name} has {}", size(*needed), size(*available))]
    Device {
        /// The device.
        name: String,
        /// Bytes that are needed.
        needed: u64,
        /// Bytes that the device has.
        available: u64,
    },
    /// A buffer, or one binding of it, is larger than the device allows.
    #[error("a buffer for {what} takes {}, but {name} allows at most {}", size(*needed), size(*allowed))]
    Buffer {
        /// The device.
        name: String,
        /// The contents of the buffer.
        what: String,
        /// Bytes that are needed.
        needed: u64,
        /// The largest size that the device allows.
        allowed: u64,
    },
    /// The device ran out of memory during the match.
    #[error("{name} is out of memory")]
    Exhausted {
        /// The device.
        name: String,
    },
}

/// The purpose of memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Purpose {
    /// Matching: its size follows from the image, the range and the method.
    Match,
    /// Reading or preparing an image: its size follows from the image alone.
    Image,
}

/// The result type of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// An [`Error::Read`] for `path`.
    pub fn read(path: impl AsRef<Path>, cause: impl Into<ReadError>) -> Self {
        Self::Read { path: path.as_ref().to_owned(), cause: cause.into() }
    }

    /// An [`Error::Read`] for the file `path`, whose name the user gave.
    pub(crate) fn opening(path: &Path, error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::NotFound => {
                Self::read(path, Reason::from_io(error, "there is no such file; check the name"))
            }
            _ => Self::read(path, error),
        }
    }

    /// An [`Error::Write`] for `path`.
    pub fn write(path: impl AsRef<Path>, reason: impl Into<Reason>) -> Self {
        Self::Write { path: path.as_ref().to_owned(), reason: reason.into() }
    }

    /// An [`Error::Option`] for `key`.
    pub fn option(key: impl Into<String>, cause: OptionError) -> Self {
        Self::Option { key: key.into(), cause }
    }
}

/// A number of bytes in readable form.
fn size(bytes: u64) -> String {
    let [kib, mib] = [10, 20].map(|bits| bytes as f64 / f64::from(1 << bits));
    match mib {
        _ if mib < 1.0 => format!("{:.0} KiB", kib.ceil()),
        _ if mib < 1024.0 => format!("{:.0} MiB", mib.ceil()),
        _ => format!("{:.1} GiB", mib / 1024.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn system_errors_are_readable() {
        let cut = io::Error::from(io::ErrorKind::UnexpectedEof);
        let own = io::Error::new(io::ErrorKind::NotFound, "the chunk is missing");
        for (error, words) in [
            (io::ErrorKind::NotFound.into(), "it is not there"),
            (cut, "it ends too early"),
            (io::ErrorKind::WriteZero.into(), "no more can be written"),
            (own, "the chunk is missing"),
        ] {
            assert_eq!(Error::write("a", error).to_string(), format!("cannot write a: {words}"));
        }
        for code in 1..40 {
            let said = Error::read("a", io::Error::from_raw_os_error(code)).to_string();
            assert!(!said.contains("os error") && !said.contains("uncategorized"), "{said}");
        }
    }

    /// Messages of the library must not mention flags or the program.
    #[test]
    fn no_text_in_the_source_names_a_flag_or_the_program() {
        let mut files = 0;
        for path in glob::glob(concat!(env!("CARGO_MANIFEST_DIR"), "/src/**/*.rs")).unwrap() {
            let path = path.unwrap();
            files += 1;
            let source = fs::read_to_string(&path).unwrap();
            let source = source.split("#[cfg(test)]").next().unwrap();
            for line in source.lines().filter(|line| !line.trim_start().starts_with("//")) {
                let flag = line
                    .match_indices("--")
                    .any(|(at, _)| line[at + 2..].starts_with(|c: char| c.is_ascii_lowercase()));
                let tests = path.ends_with("tests.rs");
                assert!(tests || !(flag || line.contains("`mrfgs ")), "{}: {line}", path.display());
            }
        }
        assert!(files > 20, "{files}");
    }

    /// The sources of an error, nearest first.
    fn sources(error: &Error) -> Vec<&(dyn std::error::Error + 'static)> {
        std::iter::successors(std::error::Error::source(error), |error| error.source()).collect()
    }

    #[test]
    fn the_error_of_the_system_is_the_source() {
        let denied = || io::Error::from(io::ErrorKind::PermissionDenied);
        let folder = tempfile::tempdir().unwrap();
        let (missing, below) = (folder.path().join("a.png"), folder.path().join("none/a.png"));
        fs::write(folder.path().join("none"), "").unwrap();
        for (error, kind) in [
            (Error::read("a", denied()), io::ErrorKind::PermissionDenied),
            (Error::write("a", denied()), io::ErrorKind::PermissionDenied),
            (Error::write("a", Reason::from_io(denied(), "other words")), io::ErrorKind::PermissionDenied),
            (crate::image::read::grey8(&missing).unwrap_err(), io::ErrorKind::NotFound),
            (crate::text::read(&missing, 1, "file").unwrap_err(), io::ErrorKind::NotFound),
            (crate::image::read::grey8(&below).unwrap_err(), io::ErrorKind::NotADirectory),
        ] {
            let found = sources(&error).into_iter().find_map(|error| error.downcast_ref::<io::Error>());
            assert_eq!(found.map(io::Error::kind), Some(kind), "{error}");
            assert_eq!(error, error.clone());
        }
        // Controls: errors that no system error caused.
        assert_eq!(sources(&Error::write("a", "no")).len(), 1);
        assert_eq!(sources(&MemoryError::Exhausted { name: "a".into() }.into()).len(), 0);
    }

    #[test]
    fn sizes_are_rounded_up_to_what_is_enough() {
        for (bytes, text) in
            [(1, "1 KiB"), (1 << 20, "1 MiB"), ((1 << 20) + 1, "2 MiB"), (3 << 30, "3.0 GiB")]
        {
            assert_eq!(size(bytes), text);
        }
    }
}
