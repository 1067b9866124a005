//! Reads pairs with ground truth, matches them, and compares the maps.

use std::path::{Path, PathBuf};
use std::time::Duration;

use mrfgs::Matcher;
use mrfgs::maps::Maps;
use mrfgs::options::{Execution, Method};

use crate::args::{ExecutionArgs, MethodArgs, ReadingArgs, scale};
use crate::failure::{Failure, Result};
use crate::matching::{self, SearchSpace};
use crate::outputs::files;
use crate::pairs::folder::{self, Folder, Scene};

use super::findings::{Figures, Findings, Scored};
use super::prior::SampledPoints;

/// Flags for reading the ground truth and writing the figures.
#[derive(clap::Args)]
pub(super) struct SceneArgs {
    /// Writes all figures as JSON; `-` prints them instead of the table
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
    /// Grey levels per pixel of disparity, for an integer ground truth; level 0 is unknown [default: 256 for 16-bit PNG, 3 for the layout
    /// of 2005 and 2006, 4 for that of 2003]
    ///
    /// The defaults fit the small sizes, third and quarter. For 2005 and 2006 use 1 for the full size, 2 for the half size and 3 for the
    /// third size.
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = scale)]
    pub(super) truth_scale: Option<f32>,
    /// Rounds the ground truth to whole pixels, as programs have it that divide an 8-bit map by its scale in integers
    #[arg(long)]
    pub(super) truth_rounded: bool,
    #[command(flatten)]
    pub(super) reading: ReadingArgs,
}

/// A method and its name, if it needs one.
pub(super) type Called = (Option<String>, Method);

/// Flags for reading and matching pairs with ground truth.
#[derive(clap::Args)]
pub(super) struct RunArgs {
    #[command(flatten)]
    scenes: SceneArgs,

    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    execution: ExecutionArgs,
}

impl RunArgs {
    pub(super) fn json(&self) -> Option<&Path> {
        self.scenes.json.as_deref()
    }

    pub(super) fn method(&self) -> Result<Method> {
        self.method.method()
    }

    /// The first method and any others to compare, with their names if there are several.
    pub(super) fn methods(&self) -> Result<(Called, Vec<Called>)> {
        let (first, others) = self.method.each();
        let several = !others.is_empty();
        let called = |args: MethodArgs| Ok((args.name().filter(|_| several), args.method()?));
        Ok((called(first)?, others.into_iter().map(called).collect::<Result<_>>()?))
    }

    /// See [`ExecutionArgs::execution`].
    pub(super) fn execution(&self) -> Execution {
        self.execution.execution()
    }

    /// The folders, all checked: missing files are reported before the first match.
    fn folders<'a>(&self, dirs: &'a [PathBuf]) -> Result<Vec<Folder<'a>>> {
        let folders = dirs.iter().map(|dir| Folder::of(dir)).collect::<mrfgs::Result<Vec<_>>>()?;
        if self.scenes.truth_scale.is_some() && !folders.iter().any(Folder::is_scaled) {
            let reason = "no folder has an 8-bit ground truth, and disp0GT.pfm is in pixels; remove it";
            return Err(Failure::usage("--truth-scale", reason));
        }
        Ok(folders)
    }

    /// Matches every folder by `method` and passes each pair with its maps and time to `see`. Checks before any computing that the JSON can
    /// be written and does not overwrite an input. With `sampled`, points of the truth by a seed, each match has them as a prior.
    pub(super) fn match_all(
        &self,
        dirs: &[PathBuf],
        method: Method,
        execution: Execution,
        sampled: Option<(SampledPoints, u64)>,
        mut see: impl FnMut(&Scene, &Maps, Duration) -> Result<()>,
    ) -> Result<Findings> {
        let read = folder::inputs_of(dirs).chain(self.method.files().map(Path::to_owned));
        files::check_json(self.json(), read)?;
        let folders = self.folders(dirs)?;
        let mut matcher = Matcher::builder().execution(execution).build()?;
        let SceneArgs { reading, truth_scale, truth_rounded, .. } = &self.scenes;
        let mut pairs = Vec::new();
        let mut ran_on = None;
        for folder in folders {
            let mut scene = folder.read(reading.reader(), *truth_scale)?;
            let mut prior = None;
            if let Some((points, seed)) = sampled {
                let (given, rest) = points.sample(&scene.ground, seed)?;
                (prior, scene.ground) = (Some(given), rest);
            }
            if *truth_rounded {
                scene.ground = scene.ground.rounded();
            }
            let (pair, name) = (&scene.pair, Some(scene.name.as_str()));
            let searched = SearchSpace::from(scene.range).with_prior(prior.as_ref());
            let (matched, time) = matching::run(&mut matcher, pair, searched, &method, name, false, None)?;
            see(&scene, &matched.maps, time)?;
            let (ground, maps, estimate) = (&scene.ground, &matched.maps, matched.maps.final_map());
            let figures = Figures {
                raw: Some(ground.evaluate(&maps.raw_map())?),
                finished: Some(ground.evaluate(&estimate)?),
                breakdown: Some(ground.breakdown(&estimate, scene.pair.left())?),
                confidence: Some(ground.sparsify(&estimate, &maps.confidence)?),
                validity: ground.detect(&maps.validity)?,
            };
            pairs.push(Scored { name: scene.name, figures, seconds: Some(time.as_secs_f64()) });
            ran_on = Some(matched.ran_on);
        }
        Ok(Findings::new(Some(method), ran_on, pairs))
    }
}
