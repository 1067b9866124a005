//! Pairs with known truth: read, matched, and compared with it.

use std::path::{Path, PathBuf};
use std::time::Duration;

use mrfgs::Matcher;
use mrfgs::image::write;
use mrfgs::maps::Maps;
use mrfgs::options::Method;

use crate::args::method::MethodArgs;
use crate::args::reading::ReadingArgs;
use crate::failure::{Failure, Result};
use crate::matching;
use crate::outputs::files;
use crate::pairs::folder::{self, Folder, Scene};

use super::findings::{Figures, Findings};

/// How the folders are read, and where the figures go.
#[derive(clap::Args)]
pub(super) struct SceneArgs {
    #[command(flatten)]
    pub(super) figures: FigureArgs,
    #[command(flatten)]
    pub(super) reading: ReadingArgs,
}

/// How an 8-bit truth is read, and where the figures go.
#[derive(clap::Args)]
pub(super) struct FigureArgs {
    /// Writes all figures as JSON; `-` prints them instead of the table
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
    /// Levels of an 8-bit PNG truth that are one pixel of disparity; level 0 is unknown [default: 3 for the layout of
    /// 2005 and 2006, 4 for that of 2003]
    ///
    /// The defaults are those of the small sizes, third and quarter. Of 2005 and 2006 the full size has 1, the half size 2,
    /// the third size 3.
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = scale)]
    pub(super) truth_scale: Option<f32>,
}

fn scale(text: &str) -> std::result::Result<f32, String> {
    let scale = text.parse().ok().filter(|scale| (0.1..=255.0).contains(scale));
    scale.ok_or_else(|| "give a number from 0.1 to 255, such as 3".into())
}

impl SceneArgs {
    pub(super) fn json(&self) -> Option<&Path> {
        self.figures.json.as_deref()
    }

    /// Finds out before any computing whether the JSON can be written, and refuses it in place of a file that is read.
    pub(super) fn check_json(&self, dirs: &[PathBuf], method: &MethodArgs) -> Result<()> {
        let inputs = dirs.iter().flat_map(|dir| folder::inputs(dir));
        let files = method.files().map(Path::to_owned);
        check_json(self.json(), &inputs.chain(files).collect::<Vec<_>>())
    }

    /// The folders, all complete: what is missing in the last is said before the first is matched.
    pub(super) fn folders<'a>(&self, dirs: &'a [PathBuf]) -> Result<Vec<Folder<'a>>> {
        let folders = dirs.iter().map(|dir| Folder::of(dir)).collect::<mrfgs::Result<Vec<_>>>()?;
        if self.figures.truth_scale.is_some() && !folders.iter().any(Folder::is_scaled) {
            let reason = "no folder holds a truth of 8 bits, and disp0GT.pfm is in pixels; leave it out";
            return Err(Failure::Usage(format!("{}: {reason}", "--truth-scale")));
        }
        Ok(folders)
    }
}

/// Finds out before any computing whether the JSON can be written, and refuses it in place of an input.
pub(super) fn check_json(json: Option<&Path>, inputs: &[PathBuf]) -> Result<()> {
    let Some(path) = files::json_file(json) else { return Ok(()) };
    write::check_path(path)?;
    let inputs: Vec<_> = inputs.iter().map(|path| ("an input", path.as_path())).collect();
    files::distinct(&inputs, &[("--json", path)])
}

/// Matches every folder by `method`; `see` gets every pair with its maps and their time.
pub(super) fn match_all(
    args: &SceneArgs,
    folders: &[Folder],
    matcher: &mut Matcher,
    method: Method,
    mut see: impl FnMut(&Scene, &Maps, Duration) -> Result<()>,
) -> Result<Findings> {
    let mut figures = Vec::new();
    let mut ran_on = None;
    for folder in folders {
        let scene = folder.read(args.reading.reader(), args.figures.truth_scale)?;
        let (matched, time) =
            matching::run(matcher, &scene.pair, scene.range, &method, Some(&scene.name), false, None)?;
        see(&scene, &matched.maps, time)?;
        let (ground, maps, estimate) = (&scene.ground, &matched.maps, matched.maps.final_map());
        figures.push(Figures {
            raw: Some(ground.evaluate(&maps.raw_map())?),
            finished: ground.evaluate(&estimate)?,
            breakdown: Some(ground.breakdown(&estimate, scene.pair.left())?),
            confidence: Some(ground.sparsify(&estimate, &maps.confidence)?),
            validity: ground.detect(&maps.validity)?,
            name: scene.name,
            seconds: Some(time.as_secs_f64()),
        });
        ran_on = Some(matched.ran_on);
    }
    Ok(Findings::new(Some(method), ran_on, figures))
}
