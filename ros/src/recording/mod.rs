//! Recordings: MCAP files and bags of ROS 2, and bags of ROS 1.

mod bag;
mod chunk;
mod db3;
mod file;
mod mcap;
mod message;
mod sqlite;
mod write;

use std::fs;
use std::path::{Path, PathBuf};

use ::mcap::MAGIC;
use mrfgs::{Error, Result};

use crate::topics::Topic;

use bag::Bag;
use db3::Db3;
use mcap::Mcap;
pub use message::Message;
use message::messages;
pub use write::Writer;

/// The names that the files of recordings end with.
const EXTENSIONS: [&str; 3] = ["mcap", "bag", "db3"];
/// What the files of a recording in a folder end with.
const PARTS: [&str; 4] = [".mcap", ".mcap.zstd", ".db3", ".db3.zstd"];
/// Beside these.
const METADATA: &str = "metadata.yaml";

/// A recording: a file, or a folder with the files of one.
#[derive(Clone, Debug)]
pub struct Recording {
    path: PathBuf,
    files: Vec<(PathBuf, Format)>,
    topics: Vec<Topic>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Mcap,
    Bag,
    Db3,
}

impl Recording {
    /// Whether `path` is called or begins like a recording, or is a folder with one.
    #[must_use]
    pub fn is(path: &Path) -> bool {
        if path.is_dir() {
            // Folders of images may have such a file, too.
            let entries = fs::read_dir(path).into_iter().flatten().flatten();
            let is_part = |name: &str| PARTS.iter().any(|end| name.to_ascii_lowercase().ends_with(end));
            let has_parts = entries.into_iter().any(|entry| entry.file_name().to_str().is_some_and(is_part));
            return has_parts && path.join(METADATA).is_file();
        }
        extension(path).is_some() || path.is_file() && format(path).is_ok_and(|format| format.is_some())
    }

    /// Opens the recording `path` and finds its topics: in its summary, or by reading it once where it has none.
    ///
    /// # Errors
    /// [`Error::Read`] where there is no recording, or of another kind.
    pub fn open(path: &Path) -> Result<Self> {
        let mut files = Vec::new();
        if path.is_dir() {
            files = in_folder(path)?;
        } else {
            files.push((path.to_owned(), known(path)?));
        }
        let mut topics: Vec<Topic> = Vec::new();
        for (file, format) in &files {
            let more = match format {
                Format::Mcap => Mcap::topics(file)?,
                Format::Bag => Bag::topics(file)?,
                Format::Db3 => Db3::topics(file)?,
            };
            for topic in more {
                match topics.iter_mut().find(|one| one.name == topic.name) {
                    Some(one) => one.count = one.count.zip(topic.count).map(|(a, b)| a + b),
                    None => topics.push(topic),
                }
            }
        }
        topics.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(Self { path: path.to_owned(), files, topics })
    }

    /// As it was opened.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its files, in order.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().map(|(file, _)| file.as_path())
    }

    /// Its topics, by their names.
    #[must_use]
    pub fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// The messages of the topics of these names, in the order of the files. No more than a chunk is in memory. After an error, which
    /// names the file, nothing follows.
    pub fn messages(&self, names: &[&str]) -> impl Iterator<Item = Result<Message>> + Send + use<> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let mut failed = false;
        let each =
            self.files.clone().into_iter().flat_map(move |(file, format)| open(&file, format, names.clone()));
        each.take_while(move |message| {
            let before = failed;
            failed = message.is_err();
            !before
        })
    }
}

type Messages = Box<dyn Iterator<Item = Result<Message>> + Send>;

/// The messages of a file.
fn open(file: &Path, format: Format, names: Vec<String>) -> Messages {
    let opened = match format {
        Format::Mcap => Mcap::open(file, names).map(|file| Box::new(messages(file)) as Messages),
        Format::Bag => Bag::open(file, names).map(|file| Box::new(messages(file)) as Messages),
        Format::Db3 => Db3::open(file, &names).map(|file| Box::new(messages(file)) as Messages),
    };
    opened.unwrap_or_else(|error| Box::new(std::iter::once(Err(error))))
}

/// The extension of a file of a recording, in lower case.
fn extension(path: &Path) -> Option<String> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    EXTENSIONS.contains(&extension.as_str()).then_some(extension)
}

/// The format of a file, by its first bytes.
fn format(path: &Path) -> Result<Option<Format>> {
    let mut file = file::File::open(path)?;
    let start = file.take(file.left().min(16))?;
    let known = [(MAGIC, Format::Mcap), (bag::MAGIC, Format::Bag), (sqlite::MAGIC, Format::Db3)];
    Ok(known.into_iter().find(|(magic, _)| start.starts_with(magic)).map(|(_, format)| format))
}

fn known(path: &Path) -> Result<Format> {
    let reason = match format(path)? {
        Some(format) => return Ok(format),
        None if fs::metadata(path).is_ok_and(|file| file.len() == 0) => "is empty",
        None => match extension(path).as_deref() {
            Some("bag") => "is no bag of ROS 1: it does not begin with #ROSBAG V2.0",
            Some("db3") => "is no bag of ROS 2: it does not begin as a database of SQLite",
            _ => "is no MCAP file: it does not begin as one",
        },
    };
    Err(Error::read(path, reason))
}

/// The files of the recording in a folder, in order.
fn in_folder(folder: &Path) -> Result<Vec<(PathBuf, Format)>> {
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
    let mut paths: Vec<PathBuf> =
        entries.map_err(|e| Error::read(folder, e))?.into_iter().map(|entry| entry.path()).collect();
    let ends = |path: &Path, end: &str| path.to_string_lossy().to_ascii_lowercase().ends_with(end);
    if let Some(packed) = paths.iter().find(|path| ends(path, ".mcap.zstd") || ends(path, ".db3.zstd")) {
        return Err(Error::read(packed, "is packed as a whole; unpack it with `zstd -d`"));
    }
    paths.retain(|path| (ends(path, ".mcap") || ends(path, ".db3")) && path.is_file());
    if paths.is_empty() {
        return Err(Error::read(folder, "has a metadata.yaml and no MCAP or .db3 file"));
    }
    // The number at the end says their order, and 9 comes before 10.
    paths.sort_by_key(|path| {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let start = stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
        (stem[..start].to_owned(), stem[start..].parse::<u64>().ok(), stem)
    });
    paths.into_iter().map(|path| known(&path).map(|format| (path, format))).collect()
}

#[cfg(test)]
mod tests;
