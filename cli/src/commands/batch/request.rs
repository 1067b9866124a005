//! The record of a pair of a batch, written after its outputs: the request and the result.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::UNIX_EPOCH;

use mrfgs::Error;
use mrfgs::options::Method;
use serde::Serialize;
use serde_json::Value;

use crate::args::Search;
use crate::failure::{Failure, Result};
use crate::outputs::{MatchRecord, files};
use crate::pairs::list::PriorRow;
use crate::remedy;

use super::args::Args;
use super::listed::{BatchSettings, Listed};

/// The work requested for a pair. The record of a complete pair contains the same request.
#[derive(Serialize)]
pub(super) struct Request<'a> {
    inputs: Vec<InputFile>,
    #[serde(flatten)]
    search: Search,
    #[serde(flatten)]
    prior: Option<PriorRow>,
    /// All flags except those that affect no output or are recorded elsewhere; these have `serde(skip)`.
    #[serde(flatten)]
    flags: &'a Args,
    /// The names of the maps in the output folder.
    outputs: Vec<String>,
}

/// An input file at the time it was read.
#[derive(Serialize)]
struct InputFile {
    path: String,
    bytes: Option<u64>,
    /// Time of the last modification, in ms since 1970.
    modified: Option<u64>,
}

/// The state of a pair.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum State {
    /// The record says done, for the same request.
    Complete,
    /// The record says failed; with the reason.
    Failed(String),
    /// There is no record, or one of a different request.
    Missing,
}

#[derive(Serialize)]
struct Done<'a> {
    status: &'static str,
    request: &'a Request<'a>,
    /// The size of each output.
    bytes: BTreeMap<&'a str, u64>,
    warnings: &'a [String],
    #[serde(flatten)]
    found: MatchRecord<'a>,
}

#[derive(Serialize)]
struct Failed<'a> {
    status: &'static str,
    reason: &'a str,
    request: &'a Request<'a>,
    version: &'static str,
    method: &'a Method,
}

impl<'a> Request<'a> {
    pub(super) fn new(
        flags: &'a Args,
        listed: &Listed,
        base: &Path,
        given: &BatchSettings,
        outputs: Vec<String>,
    ) -> Self {
        let inputs = listed.inputs(base, given).into_iter().map(|path| {
            let about = fs::metadata(base.join(&path)).ok();
            let modified =
                about.as_ref().and_then(|about| about.modified().ok()?.duration_since(UNIX_EPOCH).ok());
            InputFile {
                path,
                bytes: about.map(|about| about.len()),
                modified: modified.and_then(|time| u64::try_from(time.as_millis()).ok()),
            }
        });
        Self {
            inputs: inputs.collect(),
            search: listed.search(),
            prior: listed.prior().cloned(),
            flags,
            outputs,
        }
    }

    pub(super) fn outputs(&self) -> &[String] {
        &self.outputs
    }

    /// The outputs named in the record `path`; none if there is no record.
    pub(super) fn recorded_outputs(path: &Path) -> Vec<String> {
        let record = read(path).unwrap_or_default();
        serde_json::from_value(record["request"]["outputs"].clone()).unwrap_or_default()
    }

    /// The state of the pair with the record `path`, whose outputs are in the same folder, for a match by `method`.
    pub(super) fn state(&self, path: &Path, method: &Method) -> State {
        let Some(record) = read(path) else { return State::Missing };
        if record["status"] == "failed" {
            return State::Failed(record["reason"].as_str().unwrap_or("for an unknown reason").to_owned());
        }
        let complete = record["status"] == "done"
            && record["version"] == env!("CARGO_PKG_VERSION")
            && same(&record["request"], self)
            && same(&record["method"], method)
            && self.outputs.iter().all(|name| {
                let size = fs::metadata(path.with_file_name(name)).ok().filter(fs::Metadata::is_file);
                size.is_some_and(|size| record["bytes"][name] == size.len())
            });
        if complete { State::Complete } else { State::Missing }
    }

    /// The text of the record `path` of a finished pair whose outputs are in the folder `staged`.
    pub(super) fn done(
        &self,
        path: &Path,
        staged: &Path,
        found: MatchRecord,
        warnings: &[String],
    ) -> Result<String> {
        let size = |name: &String| fs::metadata(staged.join(name)).map(|about| about.len());
        let sizes = self.outputs.iter().map(|name| Ok((name.as_str(), size(name)?)));
        let bytes = sizes.collect::<std::io::Result<_>>().map_err(|e| Error::write(path, e))?;
        files::json_text(path, &Done { status: "done", request: self, bytes, warnings, found })
    }

    /// The text of the record `path` of a failed pair.
    pub(super) fn failed(&self, path: &Path, method: &Method, failure: &Failure) -> Result<String> {
        let reason = &failure.message(&remedy::COLUMNS);
        let version = env!("CARGO_PKG_VERSION");
        files::json_text(path, &Failed { status: "failed", reason, request: self, version, method })
    }
}

fn read(path: &Path) -> Option<Value> {
    serde_json::from_slice(&fs::read(path).ok()?).ok()
}

/// Whether `recorded` equals `value` after writing and reading it, which rounds both alike.
fn same(recorded: &Value, value: &impl Serialize) -> bool {
    let text = serde_json::to_string(value);
    text.ok()
        .and_then(|text| serde_json::from_str::<Value>(&text).ok())
        .is_some_and(|value| value == *recorded)
}
