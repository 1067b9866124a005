//! Maps as the Middlebury stereo evaluation (version 3) takes them.
//!
//! Its upload format has a folder a pair with `disp0METHOD.pfm`, or `disp0METHOD_s.pfm` where the method leaves pixels
//! without a disparity, and `timeMETHOD.txt`, which holds nothing but the seconds.

use std::ffi::OsStr;
use std::fs;
use std::path::Path;
use std::time::Duration;

use mrfgs::image::{Plane, write};
use mrfgs::options::Fill;
use mrfgs::{Error, Result};

use crate::Failure;
use crate::outputs::StagedFolder;

/// A folder of maps in the making.
pub(super) struct Submission {
    folder: StagedFolder,
    method: String,
    /// Behind the method in the names of maps.
    ending: &'static str,
}

impl Submission {
    /// Begins the folder `dir`, a new or an empty one, for the pairs called `names`.
    pub(super) fn new(dir: &Path, method: &OsStr, names: &[String], fill: Fill) -> Result<Self, Failure> {
        let error = |reason: String| Err(Failure::Usage(format!("--submission: {reason}")));
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        let Some(method) = method.to_str().filter(|m| !m.is_empty() && m.chars().all(plain)) else {
            return error(format!("{} is no METHOD: give letters, digits, - and _", method.display()));
        };
        if method.ends_with("_s") {
            return error(format!("{method} ends in _s, the mark of sparse maps; give another METHOD"));
        }
        if let Some(twice) = names.iter().enumerate().find(|(i, name)| names[..*i].contains(name)) {
            return error(format!("two pairs are called {}; rename the folder of one", twice.1));
        }
        let ending = if fill == Fill::None { "_s" } else { "" };
        Ok(Self { folder: StagedFolder::new_or_empty(dir)?, method: method.into(), ending })
    }

    /// Where it will be.
    pub(super) fn place(&self) -> &Path {
        self.folder.place()
    }

    /// Adds the map of a pair and the time that it took.
    pub(super) fn add(&self, name: &str, map: &Plane<f32>, time: Duration) -> Result<()> {
        let Self { folder, method, ending } = self;
        let dir = folder.path().join(name);
        fs::create_dir(&dir).map_err(|e| Error::write(folder.place().join(name), e))?;
        let time = format!("{:.3}\n", time.as_secs_f64());
        write::disparity(&dir.join(format!("disp0{method}{ending}.pfm")), map)
            .and_then(|()| write::save(&dir.join(format!("time{method}.txt")), time.as_bytes()))
            .map_err(|e| folder.named(e))
    }

    /// Puts it in its place.
    pub(super) fn publish(self) -> Result<()> {
        self.folder.publish()
    }
}
