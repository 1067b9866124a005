//! Paths of outputs, and cleaning up after a failure.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use mrfgs::Error;
use mrfgs::image::write;
use serde::Serialize;

use crate::console;
use crate::failure::{Failure, Result};

/// Refuses outputs that would overwrite an input or each other; each path comes with its flag or argument.
pub(crate) fn distinct(inputs: &[(&str, &Path)], outputs: &[(&str, &Path)]) -> Result<()> {
    let mut taken: Vec<(&str, PathBuf)> =
        inputs.iter().filter_map(|(name, path)| Some((*name, place(path)?))).collect();
    for (name, path) in outputs {
        let Some(place) = place(path) else { continue };
        if let Some((other, _)) = taken.iter().find(|(_, p)| *p == place) {
            let reason = format!("{} is already {other}; give another name", path.display());
            return Err(Failure::usage(*name, reason));
        }
        taken.push((name, place));
    }
    Ok(())
}

/// The canonical path of a file, existing or not; `None` for a device or a pipe, which may be used twice.
fn place(path: &Path) -> Option<PathBuf> {
    if let Ok(place) = fs::canonicalize(path) {
        return place.is_file().then_some(place);
    }
    Some(fs::canonicalize(parent(path)).ok()?.join(path.file_name()?))
}

/// The parent of a path, `.` if it has none.
pub(crate) fn parent(path: &Path) -> &Path {
    path.parent().filter(|parent| *parent != Path::new("")).unwrap_or(Path::new("."))
}

/// The files and folders written so far. Dropping it removes them, unless they are kept.
#[derive(Default)]
pub(crate) struct Written(Vec<PathBuf>);

impl Written {
    /// Records `path` if it was written.
    pub(crate) fn note<T, E: Into<Failure>>(&mut self, path: &Path, result: Result<T, E>) -> Result<T> {
        if result.is_ok() {
            self.0
                .extend(place(path).or_else(|| fs::canonicalize(path).ok().filter(|folder| folder.is_dir())));
        }
        result.map_err(Into::into)
    }

    /// Keeps the files.
    pub(crate) fn keep(mut self) {
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
pub(crate) fn is_printed(path: &Path) -> bool {
    path == Path::new("-")
}

/// Checks before any computing that the JSON can be written.
pub(crate) fn check_json_path(json: Option<&Path>) -> mrfgs::Result<()> {
    match json {
        Some(path) if is_printed(path) => console::check_leads_somewhere(),
        Some(path) => write::check_path(path),
        None => Ok(()),
    }
}

/// The path of the JSON, unless it goes to standard output.
pub(crate) fn json_file(json: Option<&Path>) -> Option<&Path> {
    json.filter(|path| !is_printed(path))
}

/// Checks before any computing that the JSON can be written and does not overwrite an input.
pub(crate) fn check_json(json: Option<&Path>, inputs: impl IntoIterator<Item = PathBuf>) -> Result<()> {
    check_json_path(json)?;
    let Some(path) = json_file(json) else { return Ok(()) };
    let inputs: Vec<_> = inputs.into_iter().collect();
    let inputs: Vec<_> = inputs.iter().map(|path| ("an input", path.as_path())).collect();
    distinct(&inputs, &[("--json", path)])
}

/// The text of a JSON file at `path`.
pub(crate) fn json_text(path: &Path, findings: &impl Serialize) -> Result<String> {
    let text = serde_json::to_string_pretty(findings).map_err(|e| Error::write(path, e.to_string()))?;
    Ok(text + "\n")
}

/// Writes the findings as JSON if `json` is given, and prints the text unless the JSON goes to standard output. `more` writes further
/// files.
pub(crate) fn deliver(
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
    Ok(console::print(&printed)?)
}

/// Creates a folder if it does not exist, and returns whether it did so.
pub(crate) fn create_folder(path: &Path) -> io::Result<bool> {
    match fs::create_dir(path) {
        Err(e) if e.kind() == ErrorKind::AlreadyExists => Ok(false),
        made => made.map(|()| true),
    }
}

/// The canonical path of an output folder, existing or not.
pub(crate) fn folder_place(name: &Path) -> mrfgs::Result<PathBuf> {
    match fs::canonicalize(name) {
        Ok(place) if place.is_dir() => Ok(place),
        Ok(_) => Err(Error::write(name, "is a file; give a folder")),
        Err(_) => {
            let parent = parent(name);
            match (fs::canonicalize(parent), name.file_name()) {
                (Ok(parent), Some(last)) if parent.is_dir() => Ok(parent.join(last)),
                _ => Err(Error::write(name, write::no_folder(parent))),
            }
        }
    }
}
