//! What is known of each frame before it is matched.

use std::collections::HashMap;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mrfgs::image::Rect;
use mrfgs::{Error, Prior};

use crate::args::{CameraNeed, PriorArgs, PriorView};
use crate::failure::Result;

/// The word that stands for the frame before.
const LAST: &str = "last";

/// The priors of the frames.
pub(super) struct FramePriors {
    from: From,
    flags: PriorArgs,
    view: PriorView,
    /// The part of the view that is matched; `None` for all of it.
    window: Option<Rect>,
}

enum From {
    Nothing,
    /// The same for all frames.
    All(Arc<Prior>),
    /// A file for each frame, by the name of the frame. Other frames have none.
    Folder(HashMap<String, PathBuf>),
    /// The map of the frame before.
    Last,
}

impl FramePriors {
    /// The priors that the flags name, for frames of this view, of which only the `window` is matched.
    pub(super) fn new(flags: &PriorArgs, view: PriorView, window: Option<Rect>) -> Result<Self> {
        let from = match flags.file() {
            None => From::Nothing,
            Some(path) if is_last(path) => From::Last,
            Some(path) if path.is_dir() => From::Folder(by_name(path)?),
            Some(_) => flags.read(view)?.map_or(From::Nothing, From::All),
        };
        let mut priors = Self { from, flags: flags.clone(), view, window };
        if let (From::All(prior), Some(window)) = (&priors.from, &priors.window) {
            priors.from = From::All(Arc::new(prior.crop(window)));
        }
        Ok(priors)
    }

    /// Whether each frame follows from the one before.
    pub(super) fn follow(&self) -> bool {
        matches!(self.from, From::Last)
    }

    /// The prior of the frame called `name`, if it has one.
    pub(super) fn of(&self, name: &str) -> Result<Option<Arc<Prior>>> {
        match &self.from {
            From::Nothing | From::Last => Ok(None),
            From::All(prior) => Ok(Some(Arc::clone(prior))),
            From::Folder(files) => {
                let Some(file) = files.get(name) else { return Ok(None) };
                let prior = self.flags.read_file(file, self.view)?;
                Ok(Some(match &self.window {
                    Some(window) => Arc::new(prior.crop(window)),
                    None => prior,
                }))
            }
        }
    }
}

/// Why the cameras are needed, if they are.
pub(super) fn need(flags: &PriorArgs) -> Result<Option<CameraNeed>> {
    match flags.file() {
        Some(path) if path.is_dir() => Ok(by_name(path)?.values().find_map(|file| flags.need_of(file))),
        _ => Ok(flags.need()),
    }
}

/// Whether the frame before is meant, and no file.
fn is_last(path: &Path) -> bool {
    path == Path::new(LAST) && !path.exists()
}

/// The visible files of a folder by their names without the extension.
fn by_name(folder: &Path) -> Result<HashMap<String, PathBuf>> {
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
    let entries = entries.map_err(|e| Error::read(folder, e))?.into_iter().map(|entry| entry.path());
    let mut files = HashMap::new();
    for file in entries.filter(|file| file.is_file()) {
        let name = file.file_stem().map(OsStr::to_string_lossy).unwrap_or_default().into_owned();
        if name.starts_with('.') {
            continue;
        }
        if let Some(other) = files.insert(name, file.clone()) {
            let [file, other] = [file, other].map(|file| file.display().to_string());
            let reason = format!("{file} and {other} are for the same frame; keep one");
            return Err(Error::read(folder, reason).into());
        }
    }
    if files.is_empty() {
        return Err(Error::read(
            folder,
            "holds no files; give one for each frame, named after its left image",
        )
        .into());
    }
    Ok(files)
}
