//! Calibrations as users find them: files that are none are refused in one line, and those of public programs
//! and data sets are read, or recognized with a remedy.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]
#![allow(clippy::format_push_string, reason = "texts of many lines read best so")]

mod foreign;
mod forms;

use mrfgs::calibration::{self, cameras::StereoCalibration};
use std::path::PathBuf;
use tempfile::TempDir;

/// Reads files of these names and contents; the error is the text for users.
fn read<T: AsRef<[u8]>>(files: &[(&str, T)]) -> Result<StereoCalibration, String> {
    let (_folder, paths) = written(files);
    calibration::read(&paths).map_err(|error| error.to_string())
}

fn written<T: AsRef<[u8]>>(files: &[(&str, T)]) -> (TempDir, Vec<PathBuf>) {
    let folder = tempfile::tempdir().unwrap();
    let write = |(name, bytes): &(&str, T)| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let paths = files.iter().map(write).collect();
    (folder, paths)
}

/// Whether `told` is one line that names `file` and has all `words`, which are separated by ` & `.
fn says(told: &str, file: &str, words: &str) -> bool {
    told.lines().count() == 1
        && !told.chars().any(char::is_control)
        && told.contains(file)
        && words.split(" & ").all(|word| told.contains(word))
}
