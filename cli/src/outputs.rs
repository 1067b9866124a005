//! Outputs: all checked before any computing, all written or none left behind.

use std::fs;
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};

use mrfgs::image::write;
use mrfgs::{Error, Result};
use serde::Serialize;

use crate::Failure;
use crate::claim::{Claim, FOLDERS};

/// Refuses outputs that would overwrite an input or each other; each comes with the name of its flag or argument.
pub(super) fn distinct(inputs: &[(&str, &Path)], outputs: &[(&str, &Path)]) -> Result<(), Failure> {
    let mut taken: Vec<(&str, PathBuf)> =
        inputs.iter().filter_map(|(name, path)| Some((*name, place(path)?))).collect();
    for (name, path) in outputs {
        let Some(place) = place(path) else { continue };
        if let Some((other, _)) = taken.iter().find(|(_, p)| *p == place) {
            let path = path.display();
            return Err(Failure::Usage(format!("{name}: {path} is {other} already; give another name")));
        }
        taken.push((name, place));
    }
    Ok(())
}

/// Where a file is, or would be, however its path is spelt; `None` for a device or a pipe, which any number may share.
fn place(path: &Path) -> Option<PathBuf> {
    if let Ok(place) = fs::canonicalize(path) {
        return place.is_file().then_some(place);
    }
    Some(fs::canonicalize(parent(path)).ok()?.join(path.file_name()?))
}

/// Where a path leads without its last part.
fn parent(path: &Path) -> &Path {
    path.parent().filter(|parent| *parent != Path::new("")).unwrap_or(Path::new("."))
}

/// Refuses a file or folder in a folder that is replaced as a whole; each comes with the name of its flag.
pub(super) fn outside(
    (folder_name, folder): (&str, &Path),
    (name, path): (&str, &Path),
) -> Result<(), Failure> {
    if path == folder || fs::canonicalize(parent(path)).is_ok_and(|parent| parent.starts_with(folder)) {
        let path = path.display();
        return Err(Failure::Usage(format!(
            "{name}: {path} lies in the folder of {folder_name}; give another name"
        )));
    }
    Ok(())
}

/// The files and folders written so far: gone again when dropped, unless kept.
#[derive(Default)]
pub(super) struct Written(Vec<PathBuf>);

impl Written {
    /// Notes that `path` has been written, if that went well.
    pub(super) fn note(&mut self, path: &Path, result: Result<()>) -> Result<()> {
        result?;
        self.0.extend(place(path).or_else(|| fs::canonicalize(path).ok().filter(|folder| folder.is_dir())));
        Ok(())
    }

    /// Says that all went well.
    pub(super) fn keep(mut self) {
        self.0.clear();
    }
}

impl Drop for Written {
    fn drop(&mut self) {
        for path in &self.0 {
            let _ = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
        }
    }
}

/// Whether an output goes to standard output.
pub(super) fn is_printed(path: &Path) -> bool {
    path == Path::new("-")
}

/// Refuses to send a map to a terminal.
pub(super) fn check_standard_output() -> Result<()> {
    if std::io::stdout().is_terminal() {
        let reason = "is a terminal, which shows no map; redirect it, or give the name of a file";
        return Err(Error::write("standard output", reason));
    }
    Ok(())
}

/// Writes data to standard output. A reader that leaves before the end has no whole map, so unlike with text that is a
/// failure.
pub(super) fn print_data(bytes: &[u8]) -> Result<()> {
    let mut out = std::io::stdout().lock();
    out.write_all(bytes).and_then(|()| out.flush()).map_err(|e| match e.kind() {
        ErrorKind::BrokenPipe => Error::write("standard output", "its reader left before the end of the map"),
        _ => Error::write("standard output", e),
    })
}

/// The file that the JSON goes to, unless it is printed.
pub(super) fn json_file(json: Option<&Path>) -> Option<&Path> {
    json.filter(|path| !is_printed(path))
}

/// The text of a JSON file at `path`.
pub(super) fn json_text(path: &Path, findings: &impl Serialize) -> Result<String> {
    let text = serde_json::to_string_pretty(findings).map_err(|e| Error::write(path, e))?;
    Ok(text + "\n")
}

/// Hands out findings: as JSON where it is asked for, what `more` writes, and for people unless the JSON is printed.
pub(super) fn deliver(
    json: Option<&Path>,
    findings: &impl Serialize,
    text: &str,
    more: impl FnOnce(&mut Written) -> Result<()>,
) -> Result<()> {
    let mut written = Written::default();
    let mut printed = text.to_owned();
    if let Some(path) = json {
        let json = json_text(path, findings)?;
        match json_file(Some(path)) {
            Some(file) => written.note(file, write::save(file, json.as_bytes()))?,
            None => printed = json,
        }
    }
    more(&mut written)?;
    written.keep();
    crate::print(&printed)
}

/// Where a folder for outputs is, or would be.
pub(super) fn folder_place(name: &Path) -> Result<PathBuf> {
    match fs::canonicalize(name) {
        Ok(place) if place.is_dir() => Ok(place),
        Ok(_) => Err(Error::write(name, "is a file; give the name of a folder")),
        Err(_) => {
            let parent = parent(name);
            match (fs::canonicalize(parent), name.file_name()) {
                (Ok(parent), Some(last)) if parent.is_dir() => Ok(parent.join(last)),
                _ => {
                    let reason = format!("there is no folder {}; create it first", parent.display());
                    Err(Error::write(name, reason))
                }
            }
        }
    }
}

/// A folder in the making, beside the place that it takes once it is whole; gone with all it holds when dropped before, and when
/// the program is killed, by the next run that makes it.
pub(super) struct StagedFolder {
    /// As the user wrote it.
    name: PathBuf,
    place: PathBuf,
    staging: Claim,
}

impl StagedFolder {
    /// Begins the folder `name`, which may be there already.
    pub(super) fn new(name: &Path) -> Result<Self> {
        let place = folder_place(name)?;
        let (Some(beside), Some(last)) = (place.parent(), place.file_name()) else {
            return Err(Error::write(name, "has no name; give the name of a folder"));
        };
        let staging = Claim::new(beside, last).map_err(|e| match e {
            Error::Write { reason, .. } => {
                Error::write(name, reason.replacen("in it", &format!("in {}", beside.display()), 1))
            }
            other => other,
        })?;
        let staging = staging.ok_or_else(|| {
            Error::write(name, "another run is writing it; wait for that, or give another name")
        })?;
        let staged = Self { name: name.to_owned(), place, staging };
        fs::create_dir(staged.path()).map_err(|e| Error::write(name, e))?;
        Ok(staged)
    }

    /// Begins the folder `name`, which must be new or empty.
    pub(super) fn new_or_empty(name: &Path) -> Result<Self> {
        let staged = Self::new(name)?;
        match fs::read_dir(&staged.place).map(|mut entries| entries.next().is_none()) {
            Ok(false) => Err(Error::write(name, "the folder is not empty; name a new one")),
            _ => Ok(staged),
        }
    }

    /// Where it will be.
    pub(super) fn place(&self) -> &Path {
        &self.place
    }

    /// Where it is made.
    pub(super) fn path(&self) -> PathBuf {
        self.staging.folder().join(FOLDERS[0])
    }

    /// An error that tells the place of a file in the making as one that tells the folder.
    pub(super) fn named(&self, error: Error) -> Error {
        match error {
            Error::Write { path, reason } if path.starts_with(self.staging.folder()) => {
                Error::write(&self.name, reason)
            }
            other => other,
        }
    }

    /// Puts it in its place; what was there goes, and comes back when that fails.
    pub(super) fn publish(self) -> Result<()> {
        let error = |e: std::io::Error| Error::write(&self.name, e);
        let old = self.staging.folder().join(FOLDERS[1]);
        let replaces = self.place.exists();
        if replaces {
            fs::rename(&self.place, &old).map_err(error)?;
        }
        fs::rename(self.path(), &self.place).map_err(|e| {
            if replaces {
                let _ = fs::rename(&old, &self.place);
            }
            error(e)
        })
    }
}
