//! What `mrfgs match` writes: all checked before any computing, all written or none left behind.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use mrfgs::depth::Rig;
use mrfgs::image::colour::{self, ColourMap};
use mrfgs::image::{Image, pfm, ply, write};
use mrfgs::maps::Maps;
use mrfgs::options::DisparityRange;
use mrfgs::{Error, Result};

use crate::intermediates::Intermediates;
use crate::outputs::{self, StagedFolder, Written};
use crate::sidecar::Sidecar;
use crate::sign::Sign;
use crate::{Failure, plural};

/// The outputs besides the map.
#[derive(clap::Args)]
#[command(next_help_heading = "More outputs")]
pub(super) struct MoreOutputs {
    /// Writes the map before post-processing too, as OUTPUT by extension
    #[arg(long, value_name = "FILE")]
    raw: Option<PathBuf>,
    /// Writes the depth of every disparity too, as float: .pfm (+infinity where there is none) or .tif (NaN)
    #[arg(long, value_name = "FILE")]
    depth: Option<PathBuf>,
    /// Writes points with the colours of LEFT and their confidence (`quality`) too: binary PLY, x to the right, y down, z
    /// forward of the left camera. What is invalid, filled in or of low confidence is left out
    #[arg(long, value_name = "FILE")]
    point_cloud: Option<PathBuf>,
    /// Writes the confidence too: 8-bit PNG, 0 to 255, how far the best runner-up is behind in 1/8 nat
    #[arg(long, value_name = "FILE")]
    confidence: Option<PathBuf>,
    /// Writes why each pixel is what it is: 8-bit PNG, the sum of 1 match outside the right image, 2 occluded, 4 in a
    /// small region, 8 low confidence, 16 filled, 32 masked; 0 is measured and trusted
    #[arg(long, value_name = "FILE")]
    validity: Option<PathBuf>,
    /// Writes every step as a picture or a small table into a new folder: corrected images, zones, matches, label ranges, costs,
    /// graphs, a map for each level, the change of each iteration. Takes a multiple of the time
    #[arg(long, value_name = "DIR")]
    pub(super) intermediates: Option<PathBuf>,
    /// Writes the map in colours too, with a scale: PNG
    #[arg(long, value_name = "FILE")]
    preview: Option<PathBuf>,
    /// Colours of the preview, from far to near [default: turbo]
    #[arg(long, value_name = "NAME", requires = "preview")]
    colours: Option<Colours>,
    /// Puts LEFT beside the map in the preview
    #[arg(long, requires = "preview")]
    side_by_side: bool,
    /// Writes what ran and what came of it as JSON; `-` prints it
    ///
    /// It has `version`, `files` (`left`, `right`, `mask`, `calibration`, `output`), `width`, `height`, `sign`, `range`
    /// (`min`, `max`), `labels`, `method` (every key), `ran_on`, `driver` (of the device), `note` (why it is not the device hoped for),
    /// `tiles`, `iterations`, `seconds` (of the match), `stages` (ms by stage and level, with --timings), and of all pixels, in
    /// percent: `density` (with a disparity), `measured` and `filled`, which add up to it; `mean_confidence` is that of the
    /// measured ones.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// The colours of a preview.
#[derive(Clone, Copy, ValueEnum)]
enum Colours {
    /// Cold to warm
    Turbo,
    /// Violet to yellow, with even steps of lightness
    Viridis,
    /// Dark to bright
    Grey,
}

impl From<Colours> for ColourMap {
    fn from(colours: Colours) -> Self {
        match colours {
            Colours::Turbo => Self::Turbo,
            Colours::Viridis => Self::Viridis,
            Colours::Grey => Self::Grey,
        }
    }
}

/// What there is to write.
pub(super) struct Outcome<'a> {
    /// The left image, where an output [shows it](MoreOutputs::show_left).
    pub(super) left: Option<&'a Image>,
    /// The cameras, where an output [takes them](MoreOutputs::take_cameras).
    pub(super) rig: Option<Rig>,
    pub(super) maps: &'a Maps,
    pub(super) range: DisparityRange,
    pub(super) sign: Sign,
    pub(super) sidecar: Sidecar<'a>,
}

impl MoreOutputs {
    /// The first flag that takes the cameras, where there is one.
    pub(super) fn take_cameras(&self) -> Option<&'static str> {
        let flags = [("--depth", &self.depth), ("--point-cloud", &self.point_cloud)];
        flags.into_iter().find_map(|(flag, path)| path.is_some().then_some(flag))
    }

    /// Whether the left image is needed.
    pub(super) fn show_left(&self) -> bool {
        self.point_cloud.is_some() || self.side_by_side
    }

    /// Finds out before any computing whether all outputs can be written; `inputs` come with their names.
    pub(super) fn check(
        &self,
        output: &Path,
        inputs: &[(&str, &Path)],
        range: DisparityRange,
    ) -> Result<(), Failure> {
        let steps = self.intermediates.as_deref().map(StagedFolder::new_or_empty).transpose()?;
        if outputs::is_printed(output) {
            outputs::check_standard_output()?;
        } else {
            write::check_disparity_path(output, range.min, range.max)?;
        }
        if let Some(path) = &self.raw {
            write::check_disparity_path(path, range.min, range.max)?;
        }
        self.depth.as_deref().map_or(Ok(()), write::check_depth_path)?;
        self.point_cloud.as_deref().map_or(Ok(()), write::check_ply_path)?;
        for path in [&self.confidence, &self.validity, &self.preview].into_iter().flatten() {
            write::check_png_path(path)?;
        }
        outputs::json_file(self.json.as_deref()).map_or(Ok(()), write::check_path)?;
        let flags = [
            ("--raw", &self.raw),
            ("--depth", &self.depth),
            ("--point-cloud", &self.point_cloud),
            ("--confidence", &self.confidence),
            ("--validity", &self.validity),
            ("--preview", &self.preview),
            ("--json", &self.json),
        ];
        let flags = flags.into_iter().filter_map(|(name, path)| Some((name, path.as_deref()?)));
        let mut files: Vec<_> = std::iter::once(("OUTPUT", output)).chain(flags).collect();
        if let Some(steps) = &steps {
            files.iter().try_for_each(|file| outputs::outside(("--intermediates", steps.place()), *file))?;
        }
        files.extend(self.intermediates.as_deref().map(|folder| ("--intermediates", folder)));
        outputs::distinct(inputs, &files)
    }

    /// Writes all outputs or leaves none of them. Returns what there is to say of depths and points.
    pub(super) fn write(
        &self,
        output: &Path,
        outcome: &Outcome,
        steps: Option<Intermediates>,
    ) -> Result<String> {
        let &Outcome { left, rig, maps, range, sign, ref sidecar } = outcome;
        let map = || maps.final_map();
        let mut written = Written::default();
        let mut said = Vec::new();
        if !outputs::is_printed(output) {
            written.note(output, write::disparity(output, &sign.map(map())))?;
        }
        if let Some(path) = &self.raw {
            written.note(path, write::disparity(path, &sign.map(maps.raw_map())))?;
        }
        if let (Some(path), Some(rig)) = (&self.depth, &rig) {
            let depths = rig.depths(&map());
            written.note(path, write::depth(path, &depths))?;
            let known = || depths.data().iter().copied().filter(|depth| depth.is_finite());
            said.push(match known().reduce(f32::min).zip(known().reduce(f32::max)) {
                Some((least, most)) => format!("depths {least:.3} to {most:.3}"),
                None => "no pixel has a depth".into(),
            });
        }
        if let (Some(path), Some(rig), Some(left)) = (&self.point_cloud, &rig, left) {
            let points = rig.points(maps, left);
            written.note(path, ply::write(path, &points))?;
            said.push(format!("{} point{}", points.len(), plural(points.len())));
        }
        if let Some(path) = &self.confidence {
            written.note(path, write::grey8(path, &maps.confidence))?;
        }
        if let Some(path) = &self.validity {
            written.note(path, write::grey8(path, &maps.validity))?;
        }
        if let Some(path) = &self.preview {
            let colours = self.colours.map(ColourMap::from).unwrap_or_default();
            let mut picture = colour::preview(&map(), range.min as f32, range.max as f32, colours);
            if let Some(left) = left.filter(|_| self.side_by_side) {
                picture = colour::side_by_side(&left.to_rgb8(), &picture);
            }
            written.note(path, write::rgb8(path, &picture))?;
        }
        let json =
            self.json.as_deref().map(|path| Ok::<_, Error>((path, outputs::json_text(path, sidecar)?)));
        let json = json.transpose()?;
        if let Some((path, text)) = json.as_ref().filter(|(path, _)| !outputs::is_printed(path)) {
            written.note(path, write::save(path, text.as_bytes()))?;
        }
        if let (Some(steps), Some(folder)) = (steps, &self.intermediates) {
            written.note(folder, steps.finish())?;
        }
        // What is printed cannot be taken back, so it comes last.
        if outputs::is_printed(output) {
            outputs::print_data(&pfm::encode(&sign.map(map())))?;
        }
        written.keep();
        if let Some((_, text)) = json.filter(|(path, _)| outputs::is_printed(path)) {
            crate::print(&text)?;
        }
        Ok(said.join("; "))
    }
}
