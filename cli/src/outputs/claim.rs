//! Locks that let only one run at a time write a pair of a batch or an output folder.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use mrfgs::error::Reason;
use mrfgs::{Error, Result};
use same_file::Handle;

/// The name of the lock file.
const LOCK: &str = "lock";
/// Folders in a staging folder: the new one, and the old one while it is being replaced.
pub(crate) const FOLDERS: [&str; 2] = ["new", "old"];

/// This run's claim to a pair or a folder, with the staging folder in which its files are made. The folder stays locked while the claim
/// lives and is then removed. The lock ends with the process in any case; a killed run leaves an unlocked folder.
pub(crate) struct Claim {
    folder: PathBuf,
    /// Keeps the lock.
    _lock: File,
}

impl Claim {
    /// Claims `name` in the output folder `parent` and removes what a killed run left of it; `None` if another run holds it.
    pub(crate) fn new(parent: &Path, name: impl AsRef<OsStr>) -> Result<Option<Self>> {
        let folder = staging(parent, name.as_ref());
        let failed = |e: io::Error| Error::write(&folder, e);
        loop {
            if let Err(e) = fs::create_dir(&folder)
                && e.kind() != ErrorKind::AlreadyExists
            {
                let reason = Reason::from(e);
                return Err(Error::write(
                    parent,
                    reason.reworded(|words| format!("nothing can be created in it: {words}")),
                ));
            }
            let path = folder.join(LOCK);
            let lock = match File::options().write(true).create(true).truncate(false).open(&path) {
                // Its owner has just removed the folder.
                Err(e) if e.kind() == ErrorKind::NotFound => continue,
                lock => lock.map_err(failed)?,
            };
            match lock.try_lock() {
                Err(TryLockError::WouldBlock) => return Ok(None),
                // Some network file systems have no locks; there, concurrent runs are up to the user.
                Err(TryLockError::Error(_)) | Ok(()) => {}
            }
            let locked = Handle::from_file(lock.try_clone().map_err(failed)?).map_err(failed)?;
            if Handle::from_path(&path).is_ok_and(|there| there == locked) {
                let claim = Self { folder: folder.clone(), _lock: lock };
                claim.clear().map_err(failed)?;
                return Ok(Some(claim));
            }
            // The lock file was removed between opening and locking, so it protects nothing. Try again.
        }
    }

    /// Removes what a killed run left of `name`, unless another run holds it.
    pub(crate) fn remove_remains(parent: &Path, name: &str) -> Result<()> {
        if staging(parent, name.as_ref()).exists() {
            Self::new(parent, name)?;
        }
        Ok(())
    }

    /// The staging folder.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Removes everything but the lock.
    fn clear(&self) -> io::Result<()> {
        for entry in fs::read_dir(&self.folder)? {
            let entry = entry?;
            // Folders with other names are not ours: the claim fails.
            if FOLDERS.iter().any(|name| entry.file_name() == *name) {
                fs::remove_dir_all(entry.path())?;
            } else if entry.file_name() != LOCK {
                fs::remove_file(entry.path())?;
            }
        }
        Ok(())
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        // Remove the lock last: after that the folder may be another run's.
        if self.clear().is_ok() && fs::remove_file(self.folder.join(LOCK)).is_ok() {
            let _ = fs::remove_dir(&self.folder);
        }
    }
}

/// The staging folder for `name`. Its name is fixed, so that the next run finds the remains of a killed one.
fn staging(parent: &Path, name: &OsStr) -> PathBuf {
    let mut folder = OsString::from(".");
    folder.push(name);
    folder.push(".tmp");
    parent.join(folder)
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn a_pair_is_claimed_once() {
        let folder = tempfile::tempdir().unwrap();
        let claimed = || Claim::new(folder.path(), "a").unwrap();
        let first = claimed().unwrap();
        fs::write(first.folder().join("a.pfm"), "half").unwrap();
        assert!(claimed().is_none() && Claim::new(folder.path(), "b").unwrap().is_some());
        Claim::remove_remains(folder.path(), "a").unwrap();
        assert!(first.folder().join("a.pfm").exists(), "only the owner removes it");
        drop(first);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        assert!(claimed().is_some());

        // A killed run leaves the lock file, but no lock.
        let remains = staging(folder.path(), "a".as_ref());
        fs::create_dir_all(remains.join("new/below")).unwrap();
        for file in ["lock", "a.pfm", "new/b.pfm"] {
            fs::write(remains.join(file), "half").unwrap();
        }
        let claim = claimed().unwrap();
        assert!(!claim.folder().join("a.pfm").exists() && !claim.folder().join("new").exists());
        drop(claim);
        assert!(!remains.exists());
    }

    #[test]
    fn claims_shut_each_other_out() {
        let folder = tempfile::tempdir().unwrap();
        let inside = AtomicUsize::new(0);
        let held = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    while held.load(Ordering::SeqCst) < 100 {
                        let Some(claim) = Claim::new(folder.path(), "a").unwrap() else { continue };
                        assert_eq!(inside.fetch_add(1, Ordering::SeqCst), 0);
                        fs::write(claim.folder().join("a.pfm"), "map").unwrap();
                        held.fetch_add(1, Ordering::SeqCst);
                        inside.fetch_sub(1, Ordering::SeqCst);
                    }
                });
            }
        });
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
