//! Folders that appear complete or not at all.

use std::fs;
use std::path::{Path, PathBuf};

use mrfgs::error::Reason;
use mrfgs::{Error, Result};

use crate::failure::{self, Failure};
use crate::outputs::claim::{Claim, FOLDERS};
use crate::outputs::files::{check_json_path, folder_place, json_file, parent};

/// A folder being written, moved to its place once complete. Dropped earlier, it is removed; after a killed run, the next one removes it.
pub(crate) struct StagedFolder {
    /// As the user wrote it.
    name: PathBuf,
    place: PathBuf,
    staging: Claim,
}

impl StagedFolder {
    /// Begins the folder `name`, which may exist.
    pub(crate) fn new(name: &Path) -> Result<Self> {
        let place = folder_place(name)?;
        let (Some(beside), Some(last)) = (place.parent(), place.file_name()) else {
            return Err(Error::write(name, Reason::of_request("has no name; give a folder")));
        };
        let staging = Claim::new(beside, last).map_err(|e| match e {
            Error::Write { reason, .. } => {
                let place = format!("in {}", beside.display());
                Error::write(name, reason.reworded(|words| words.replacen("in it", &place, 1)))
            }
            other => other,
        })?;
        let staging = staging.ok_or_else(|| {
            Error::write(name, "another run is writing it; wait until it ends, or give another name")
        })?;
        let staged = Self { name: name.to_owned(), place, staging };
        fs::create_dir(staged.path()).map_err(|e| Error::write(name, e))?;
        Ok(staged)
    }

    /// Begins the folder `name`, which must be new or empty.
    pub(crate) fn new_or_empty(name: &Path) -> Result<Self> {
        let staged = Self::new(name)?;
        match fs::read_dir(&staged.place).map(|mut entries| entries.next().is_none()) {
            Ok(false) => Err(staged.error("the folder is not empty; give a new one")),
            _ => Ok(staged),
        }
    }

    /// Refuses JSON that cannot be written or lies in the folder, which is replaced as a whole; `flag` names the folder.
    pub(crate) fn check_json(&self, flag: &str, json: Option<&Path>) -> Result<(), Failure> {
        check_json_path(json)?;
        let Some(path) = json_file(json) else { return Ok(()) };
        let beside = fs::canonicalize(parent(path));
        if path == self.place || beside.is_ok_and(|parent| parent.starts_with(&self.place)) {
            let reason = format!("{} is inside the folder of {flag}; give another path", path.display());
            return Err(Failure::usage("--json", reason));
        }
        Ok(())
    }

    /// A write error that names the folder.
    pub(crate) fn error(&self, reason: impl Into<Reason>) -> Error {
        Error::write(&self.name, reason)
    }

    /// The final path.
    pub(crate) fn place(&self) -> &Path {
        &self.place
    }

    /// The temporary path.
    pub(crate) fn path(&self) -> PathBuf {
        self.staging.folder().join(FOLDERS[0])
    }

    /// Makes an error about a temporary file name the folder.
    pub(crate) fn named(&self, error: Error) -> Error {
        match &error {
            Error::Write { path, .. } if path.starts_with(self.staging.folder()) => {
                failure::at(error, &self.name)
            }
            _ => error,
        }
    }

    /// Moves the folder to its place. If that fails, the old folder is restored.
    pub(crate) fn publish(self) -> Result<()> {
        let error = |e: std::io::Error| self.error(e);
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
