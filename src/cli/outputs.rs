//! Outputs: all checked before any computing, all written or none left behind.

use std::fs;
use std::path::{Path, PathBuf};

use mrfgs::{Error, Result};

/// Refuses outputs that would overwrite an input or each other; each comes with the name of its flag or argument.
pub(super) fn distinct(inputs: &[(&str, &Path)], outputs: &[(&str, &Path)]) -> Result<()> {
    let mut taken: Vec<(&str, PathBuf)> =
        inputs.iter().filter_map(|(name, path)| Some((*name, place(path)?))).collect();
    for (name, path) in outputs {
        let Some(place) = place(path) else { continue };
        if let Some((other, _)) = taken.iter().find(|(_, p)| *p == place) {
            let reason = format!("{} is {other} already; give another name", path.display());
            return Err(Error::option(*name, reason));
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
    let folder = match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    Some(fs::canonicalize(folder).ok()?.join(path.file_name()?))
}

/// The files written so far: gone again when dropped, unless kept.
#[derive(Default)]
pub(super) struct Written(Vec<PathBuf>);

impl Written {
    /// Notes that `path` has been written, if that went well.
    pub(super) fn note(&mut self, path: &Path, result: Result<()>) -> Result<()> {
        result?;
        self.0.extend(place(path));
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
            let _ = fs::remove_file(path);
        }
    }
}
