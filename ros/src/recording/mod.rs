//! Recordings: MCAP files, ROS 2 bags, and ROS 1 bags.

mod bag;
mod chunk;
mod db3;
mod file;
mod mcap;
mod message;
mod metadata;
mod place;
mod sqlite;
mod write;

use std::collections::HashSet;
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
use metadata::Metadata;
use place::Place;
pub use write::Writer;

/// Extensions of recordings.
const EXTENSIONS: [&str; 3] = ["mcap", "bag", "db3"];
/// Endings of the files of a recording in a folder.
const PARTS: [&str; 4] = [".mcap", ".mcap.zstd", ".db3", ".db3.zstd"];
/// The ending of a file that is compressed as a whole.
const PACKED: &str = ".zstd";
/// The file with the metadata beside these.
const METADATA: &str = "metadata.yaml";

/// A recording: a file, or a folder with its files.
#[derive(Clone, Debug)]
pub struct Recording {
    path: PathBuf,
    files: Vec<(Place, Format)>,
    topics: Vec<Topic>,
    /// The number of messages according to the metadata, if known.
    claimed: Option<u64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Mcap,
    Bag,
    Db3,
}

impl Recording {
    /// Whether `path` is named like a recording, starts like one, or is a folder with one.
    #[must_use]
    pub fn is(path: &Path) -> bool {
        if path.is_dir() {
            // Folders of images may contain such a file, too.
            let entries = fs::read_dir(path).into_iter().flatten().flatten();
            let has_parts = entries.into_iter().any(|entry| is_part(&entry.path()));
            return has_parts && path.join(METADATA).is_file();
        }
        let begins_as_one = || format(&Place::plain(path)).is_ok_and(|format| format.is_some());
        extension(path).is_some() || is_part(path) || path.is_file() && begins_as_one()
    }

    /// Opens the recording `path` and finds its topics, in its summary or by reading it once.
    ///
    /// # Errors
    /// [`Error::Read`] if it is not a recording of a supported kind.
    pub fn open(path: &Path) -> Result<Self> {
        let (paths, claimed) = if path.is_dir() { in_folder(path)? } else { (vec![path.to_owned()], None) };
        let files = paths.iter().map(|path| known(path)).collect::<Result<Vec<_>>>()?;
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
        Ok(Self { path: path.to_owned(), files, topics, claimed })
    }

    /// The number of messages in `metadata.yaml` and the number found, if fewer.
    #[must_use]
    pub fn missing(&self) -> Option<(u64, u64)> {
        let found = self.topics.iter().map(|topic| topic.count).sum::<Option<u64>>()?;
        self.claimed.filter(|claimed| *claimed > found).map(|claimed| (claimed, found))
    }

    /// The path that was opened.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its files, in order.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().map(|(file, _)| file.path.as_path())
    }

    /// Its topics, sorted by name.
    #[must_use]
    pub fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// The messages of the topics `names`, in the order of the files. At most one chunk is in memory. An error, which names the file, ends
    /// the iterator.
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
fn open(file: &Place, format: Format, names: Vec<String>) -> Messages {
    let opened = match format {
        Format::Mcap => Mcap::open(file, names).map(|file| Box::new(messages(file)) as Messages),
        Format::Bag => Bag::open(file, names).map(|file| Box::new(messages(file)) as Messages),
        Format::Db3 => Db3::open(file, &names).map(|file| Box::new(messages(file)) as Messages),
    };
    opened.unwrap_or_else(|error| Box::new(std::iter::once(Err(error))))
}

/// The extension of a recording's file, in lower case.
fn extension(path: &Path) -> Option<String> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    EXTENSIONS.contains(&extension.as_str()).then_some(extension)
}

/// Whether `path` is named like a file of a recording in a folder.
fn is_part(path: &Path) -> bool {
    let name = path.to_string_lossy().to_ascii_lowercase();
    PARTS.iter().any(|end| name.ends_with(end))
}

/// The format of a file, by its first bytes.
fn format(place: &Place) -> Result<Option<Format>> {
    let mut file = file::File::open(place)?;
    let start = file.take(file.left().min(16))?;
    let known = [(MAGIC, Format::Mcap), (bag::MAGIC, Format::Bag), (sqlite::MAGIC, Format::Db3)];
    Ok(known.into_iter().find(|(magic, _)| start.starts_with(magic)).map(|(_, format)| format))
}

/// A file of a recording with its format.
fn known(path: &Path) -> Result<(Place, Format)> {
    let place = Place::of(path)?;
    let reason = match format(&place)? {
        Some(format) => return Ok((place, format)),
        None if fs::metadata(path).is_ok_and(|file| file.len() == 0) => "is empty",
        None => match extension(Path::new(unpacked(&path.to_string_lossy()))).as_deref() {
            Some("bag") => "is not a ROS 1 bag: it does not start with #ROSBAG V2.0",
            Some("db3") => "is not a ROS 2 bag: it does not start like an SQLite database",
            _ => "is not an MCAP file: it does not start like one",
        },
    };
    Err(Error::read(path, reason))
}

/// The files of the recording in a folder, in order, and the number of messages according to the metadata.
fn in_folder(folder: &Path) -> Result<(Vec<PathBuf>, Option<u64>)> {
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
    let mut paths: Vec<PathBuf> =
        entries.map_err(|e| Error::read(folder, e))?.into_iter().map(|entry| entry.path()).collect();
    paths.retain(|path| is_part(path) && path.is_file());
    let metadata = Metadata::read(&folder.join(METADATA));
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    // The file may have been compressed or decompressed since.
    let is_there = |file: &String| paths.iter().any(|path| unpacked(&name(path)) == unpacked(file));
    if let Some(missing) = metadata.files.iter().find(|file| !is_there(file)) {
        let reason = "there is no such file, but metadata.yaml lists it; get it, or remove its line from \
                      metadata.yaml to continue without it";
        return Err(Error::read(folder.join(missing), reason));
    }
    if !["", "zstd"].contains(&metadata.packed.as_str()) {
        let packed: String = metadata.packed.chars().filter(|c| !c.is_control()).take(20).collect();
        let reason = format!(
            "is compressed by `{packed}`, but only zstd is supported; convert it with `ros2 bag convert`"
        );
        return Err(Error::read(folder, reason));
    }
    if paths.is_empty() {
        return Err(Error::read(folder, "contains a metadata.yaml but no MCAP or .db3 file"));
    }
    // `zstd -d` keeps the compressed file beside the other.
    let names: HashSet<_> = paths.iter().map(|path| name(path)).collect();
    paths.retain(|path| name(path).strip_suffix(PACKED).is_none_or(|plain| !names.contains(plain)));
    // Files are ordered by the number at the end, with 9 before 10.
    paths.sort_by_key(|path| {
        let name = unpacked(&name(path)).to_owned();
        let stem = name.rsplit_once('.').map_or(&*name, |(stem, _)| stem).to_owned();
        let start = stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
        (stem[..start].to_owned(), stem[start..].parse::<u64>().ok(), stem)
    });
    Ok((paths, metadata.count))
}

/// The name of a file before compression.
fn unpacked(name: &str) -> &str {
    name.strip_suffix(PACKED).unwrap_or(name)
}

#[cfg(test)]
mod tests;
