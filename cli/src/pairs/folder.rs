//! Folders with a pair and its ground truth, in the layouts of the Middlebury data sets.

use std::path::{Path, PathBuf};

use mrfgs::evaluation::GroundTruth;
use mrfgs::image::{Pair, Plane, calib::Calibration, read::Reader};
use mrfgs::options::DisparityRange;
use mrfgs::{Error, Result};

use crate::args::{calibrated_range, disparity};

/// The file layout of a data set.
struct Layout {
    /// Left view, right view and ground truth of the left view.
    files: [&'static str; 3],
    /// Grey levels per pixel of disparity in an 8-bit ground truth, unless the user gives a scale; `None` if the truth is in pixels and a
    /// calib.txt gives the range.
    scale: Option<f32>,
}

/// All layouts. A folder has the one of which it holds most files, the first on ties.
const LAYOUTS: [Layout; 3] = [
    Layout { files: ["im0.png", "im1.png", "disp0GT.pfm"], scale: None },
    // 2005 and 2006, third size.
    Layout { files: ["view1.png", "view5.png", "disp1.png"], scale: Some(3.0) },
    // 2003, quarter size.
    Layout { files: ["im2.png", "im6.png", "disp2.png"], scale: Some(4.0) },
];

pub(crate) const CALIBRATION: &str = "calib.txt";

/// The file name of the optional mask, in every layout.
const MASK: &str = "mask0nocc.png";

impl Layout {
    /// The files that must exist, with or without the ground truth.
    fn required(&self, truth: bool) -> impl Iterator<Item = &'static str> {
        let [left, right, known] = self.files;
        let known = truth.then_some(known);
        [left, right].into_iter().chain(known).chain(self.scale.is_none().then_some(CALIBRATION))
    }
}

/// A folder that contains every file it needs.
pub(crate) struct Folder<'a> {
    dir: &'a Path,
    layout: &'static Layout,
}

impl<'a> Folder<'a> {
    /// Detects the layout of `dir` for an evaluation; the error names a missing file.
    pub(crate) fn of(dir: &'a Path) -> Result<Self> {
        Self::holding(dir, "to evaluate", |_| true)
    }

    /// Like [`Folder::of`], for a match: the ground truth is not needed if a calib.txt gives the range.
    pub(crate) fn to_match(dir: &'a Path) -> Result<Self> {
        let calibrated = dir.join(CALIBRATION).is_file();
        Self::holding(dir, "to match", |layout| layout.scale.is_some() && !calibrated)
    }

    fn holding(dir: &'a Path, purpose: &str, truth: impl Fn(&Layout) -> bool) -> Result<Self> {
        let held = |layout: &Layout| layout.files.into_iter().filter(|file| dir.join(file).is_file()).count();
        let layout = LAYOUTS.iter().fold(&LAYOUTS[0], |a, b| if held(b) > held(a) { b } else { a });
        let described = |layout: &Layout| layout.required(truth(layout)).collect::<Vec<_>>().join(", ");
        if let Some(missing) = layout.required(truth(layout)).find(|file| !dir.join(file).is_file()) {
            let expected = match held(layout) {
                0 => LAYOUTS.iter().map(described).collect::<Vec<_>>().join("; or "),
                _ => described(layout),
            };
            let reason = format!("there is no such file; a folder {purpose} must contain {expected}");
            return Err(Error::read(dir.join(missing), reason));
        }
        Ok(Self { dir, layout })
    }

    /// Whether its ground truth has 8 bits and a scale.
    pub(crate) fn is_scaled(&self) -> bool {
        self.layout.scale.is_some()
    }

    /// Reads all files; `scale` overrides that of the layout.
    pub(crate) fn read(&self, reader: Reader, scale: Option<f32>) -> Result<Scene> {
        let calibrated = self.calibrated()?;
        let pair = self.views(reader)?;
        let ground = self.ground(reader, scale, pair.size())?;
        let range = calibrated.map_or_else(|| range_of(&ground), Ok)?;
        Ok(Scene { name: name(self.dir), pair, range, ground })
    }

    /// Reads the pair and the range; reads the ground truth only if the range depends on it.
    pub(crate) fn read_pair(&self, reader: Reader) -> Result<(Pair, DisparityRange)> {
        let calibrated = self.calibrated()?;
        let pair = self.views(reader)?;
        let known = || range_of(&self.ground(reader, None, pair.size())?);
        let range = calibrated.map_or_else(known, Ok)?;
        Ok((pair, range))
    }

    /// The range in calib.txt, if that exists.
    fn calibrated(&self) -> Result<Option<DisparityRange>> {
        let calib = self.dir.join(CALIBRATION);
        if !calib.is_file() {
            return Ok(None);
        }
        let range = calibrated_range(&calib, &Calibration::read(&calib)?, 0)?;
        let silent = || Error::read(&calib, "lacks ndisp, the number of disparities; add ndisp=N");
        range.ok_or_else(silent).map(Some)
    }

    /// The file names of the two views.
    pub(crate) fn view_names(&self) -> [&'static str; 2] {
        let [left, right, _] = self.layout.files;
        [left, right]
    }

    pub(crate) fn views(&self, reader: Reader) -> Result<Pair> {
        let [left, right] = self.view_names().map(|file| self.dir.join(file));
        reader.pair(&left, &right, None)
    }

    fn ground(&self, reader: Reader, scale: Option<f32>, size: (usize, usize)) -> Result<GroundTruth> {
        let [left, _, truth] = self.layout.files.map(|file| self.dir.join(file));
        let mask = Some(self.dir.join(MASK)).filter(|m| m.exists());
        let scale = self.layout.scale.map(|usual| scale.unwrap_or(usual));
        ground_truth(reader, &truth, scale, mask.as_deref(), &left, size)
    }
}

/// The name of the folder `dir`, also for paths such as `.`.
pub(crate) fn name(dir: &Path) -> String {
    let full = dir.canonicalize().unwrap_or_else(|_| dir.to_owned());
    full.file_name().unwrap_or(dir.as_os_str()).to_string_lossy().into_owned()
}

/// Every file in `dir` that may be read.
pub(crate) fn inputs(dir: &Path) -> impl Iterator<Item = PathBuf> {
    LAYOUTS.iter().flat_map(|layout| layout.files).chain([CALIBRATION, MASK]).map(|file| dir.join(file))
}

/// Every file in several folders that may be read.
pub(crate) fn inputs_of(dirs: &[PathBuf]) -> impl Iterator<Item = PathBuf> {
    dirs.iter().flat_map(|dir| inputs(dir))
}

/// The contents of a folder.
pub(crate) struct Scene {
    pub(crate) name: String,
    pub(crate) pair: Pair,
    pub(crate) range: DisparityRange,
    pub(crate) ground: GroundTruth,
}

/// The range from 0 to the largest known disparity, rounded up.
fn range_of(ground: &GroundTruth) -> Result<DisparityRange> {
    let known = ground.truth().data().iter().copied().filter(|d| d.is_finite());
    DisparityRange::new(0, known.fold(0.0, f32::max).ceil() as i32)
}

/// Reads the ground truth, of integers if it has a `scale`, and the mask. Both must have the `size` of the image `what`.
pub(crate) fn ground_truth(
    reader: Reader,
    truth: &Path,
    scale: Option<f32>,
    mask: Option<&Path>,
    what: &Path,
    size: (usize, usize),
) -> Result<GroundTruth> {
    fn fits<T>(plane: Plane<T>, path: &Path, what: &Path, size: (usize, usize)) -> Result<Plane<T>> {
        if plane.size() == size {
            return Ok(plane);
        }
        let (w, h) = plane.size();
        Err(Error::Mismatch(format!(
            "{} is {w} x {h} and {} is {} x {}: give files of the same pair at the same size",
            path.display(),
            what.display(),
            size.0,
            size.1
        )))
    }
    let plane = disparity(reader, truth, scale)?;
    let plane = fits(plane, truth, what, size)?;
    if !plane.data().iter().any(|d| d.is_finite()) {
        return Err(Error::read(truth, "contains no known disparity, so nothing can be compared with it"));
    }
    let mask = mask.map(|path| fits(reader.grey8(path)?, path, what, size)).transpose()?;
    GroundTruth::new(plane, mask)
}
