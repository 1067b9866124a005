//! `mrfgs evaluate submission`: maps in the format of the Middlebury stereo evaluation (version 3).
//!
//! The upload has a folder per pair with `disp0METHOD.pfm`, or `disp0METHOD_s.pfm` if the method leaves pixels without a disparity, and
//! `timeMETHOD.txt`, which contains only the seconds.

use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use mrfgs::Error;
use mrfgs::image::{Plane, write};
use mrfgs::options::Fill;

use crate::failure::{Failure, Result};
use crate::outputs::{StagedFolder, files};
use crate::pairs::folder;
use crate::stop;

use super::metrics;
use super::scenes::RunArgs;

const EXAMPLES: &str = "\
Examples:
  mrfgs evaluate submission trainingQ MRFGS MiddEval3/trainingQ/*";

/// Match pairs and write their maps for the Middlebury evaluation (version 3)
///
/// For each pair it writes DIR/PAIR/disp0METHOD.pfm, with +infinity for unknown disparities, and DIR/PAIR/timeMETHOD.txt, the time of the
/// match in seconds; PAIR is the name of the pair's folder. With --set fill=none a map counts as sparse, and _s follows METHOD. It also
/// prints the errors, as `evaluate` does.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Folder to write, new or empty; the evaluation expects the name trainingF, trainingH or trainingQ according to the size of the pairs
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Name of the method: letters, digits, - and _
    #[arg(value_name = "METHOD")]
    called: OsString,
    /// Folders with the pairs, as for `evaluate`
    #[arg(value_name = "PAIR", required = true)]
    dirs: Vec<PathBuf>,
    #[command(flatten)]
    run: RunArgs,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let execution = args.run.execution();
    stop::listen();
    let method = args.run.method()?;
    let names = args.dirs.iter().map(|dir| folder::name(dir)).collect::<Vec<_>>();
    let submission = Submission::new(&args.folder, &args.called, &names, method.refinement.fill)?;
    submission.folder.check_json("DIR", args.run.json())?;
    let findings = args.run.match_all(&args.dirs, method, execution, None, |scene, maps, time| {
        submission.add(&scene.name, &maps.final_map(), time)
    })?;
    files::deliver(args.run.json(), &findings, &metrics::text(&findings), |written| {
        let place = submission.folder.place().to_owned();
        written.note(&place, submission.folder.publish())
    })
}

/// A submission being written.
struct Submission {
    folder: StagedFolder,
    method: String,
    /// The suffix of METHOD in the names of maps.
    ending: &'static str,
}

impl Submission {
    /// Begins the folder `dir`, new or empty, for pairs with these `names`.
    fn new(dir: &Path, method: &OsStr, names: &[String], fill: Fill) -> Result<Self> {
        let error = |name: &str, reason: String| Err(Failure::usage(name, reason));
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        let Some(method) = method.to_str().filter(|m| !m.is_empty() && m.chars().all(plain)) else {
            return error(
                "METHOD",
                format!("{} cannot be part of a file name: use letters, digits, - and _", method.display()),
            );
        };
        if method.ends_with("_s") {
            return error(
                "METHOD",
                format!("{method} ends in _s, which marks sparse maps; give another name"),
            );
        }
        if let Some(twice) = names.iter().enumerate().find(|(i, name)| names[..*i].contains(name)) {
            return error(
                "PAIR",
                format!("two pairs are called {}; rename the folder of one of them", twice.1),
            );
        }
        let ending = if fill == Fill::None { "_s" } else { "" };
        Ok(Self { folder: StagedFolder::new_or_empty(dir)?, method: method.into(), ending })
    }

    /// Adds the map and the time of a pair.
    fn add(&self, name: &str, map: &Plane<f32>, time: Duration) -> Result<()> {
        let Self { folder, method, ending } = self;
        let dir = folder.path().join(name);
        fs::create_dir(&dir).map_err(|e| Error::write(folder.place().join(name), e))?;
        let time = format!("{:.3}\n", time.as_secs_f64());
        Ok(map
            .save(dir.join(format!("disp0{method}{ending}.pfm")))
            .and_then(|()| write::save(&dir.join(format!("time{method}.txt")), time.as_bytes()))
            .map_err(|e| folder.named(e))?)
    }
}
