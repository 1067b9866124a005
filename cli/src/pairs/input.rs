//! The pair that `mrfgs match` and `mrfgs inspect` take.

use std::path::{Path, PathBuf};

use mrfgs::Error;
use mrfgs::calibration::{self, matrix::Matrix};
use mrfgs::check::{self, Warning};
use mrfgs::image::Pair;
use mrfgs::image::calib::Calibration;
use mrfgs::options::DisparityRange;
use mrfgs::rectification::Options;

use crate::args::reading::ReadingArgs;
use crate::args::rectification;
use crate::args::search::{Found, Search};
use crate::args::sign::Sign;
use crate::console;
use crate::failure::{self, Result};
use crate::outputs::record::Files;
use crate::pairs::folder::CALIBRATION;
use crate::pairs::raw;
use crate::remedy;

/// The files of a pair, and how they are read.
#[derive(clap::Args)]
pub(crate) struct PairArgs {
    /// Left image, the reference view
    pub(crate) left: PathBuf,
    /// Right image, of the same size and rectified, so that matches are on the same row
    pub(crate) right: PathBuf,

    #[command(flatten)]
    pub(crate) search: Search,
    /// Calibration: the range (ndisp of a calib.txt), and the cameras for depth and points; of OpenCV, ROS (two files, each
    /// with --calib), Kalibr or Middlebury [default: a calib.txt beside LEFT]
    #[arg(long, value_name = "FILE")]
    pub(crate) calib: Vec<PathBuf>,
    /// Image of the size of LEFT: where it is not black, LEFT is ignored and the maps are invalid
    #[arg(long, value_name = "FILE")]
    pub(crate) mask: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
}

/// A pair, read.
pub(crate) struct Input {
    pub(crate) pair: Pair,
    pub(crate) range: DisparityRange,
    /// Whether sparse matches gave the range.
    by_matches: bool,
    /// The calibration of the rectified pair.
    calibration: Option<Known>,
    /// The rotation from the frame of the left camera to the rectified one, where the images were rectified.
    pub(crate) rectifying: Option<Matrix>,
}

/// A calibration of a rectified pair, and where it comes from.
struct Known {
    files: Vec<PathBuf>,
    calibration: Calibration,
}

impl Known {
    /// With the file that messages name.
    fn named(&self) -> (&Path, &Calibration) {
        (&self.files[0], &self.calibration)
    }
}

impl PairArgs {
    /// Reads the images and what the range takes, and the cameras where `cameras` asks for them. The user counts disparities
    /// by `sign`. With `rectify`, the images are as the cameras took them, and are rectified.
    pub(crate) fn read(&self, sign: Sign, cameras: bool, rectify: Option<&Options>) -> Result<Input> {
        let mut pair = self.reading.reader().pair(&self.left, &self.right, self.mask.as_deref())?;
        let files = self.calib.clone();
        let mut rectifying = None;
        let calibration = if let Some(options) = rectify {
            let rectification;
            (rectification, pair) = raw::rectify(&calibration::read(&files)?, &files, &pair, options)?;
            rectifying = Some(rectification.rotations()[0]);
            Some(Known { files, calibration: rectification.calibration()? })
        } else if !files.is_empty() {
            Some(Known { calibration: of_rectified_images(&files)?, files })
        } else if self.search.max_disparity.is_some() && !cameras {
            None
        } else {
            let files = vec![self.left.with_file_name(CALIBRATION)];
            Calibration::beside(&self.left)?.map(|calibration| Known { files, calibration })
        };
        let known = calibration.as_ref().map(Known::named);
        let Found { range, by_matches } = self.search.range(&pair, known, sign)?;
        Ok(Input { pair, range, by_matches, calibration, rectifying })
    }

    /// The paths for a record.
    pub(crate) fn files(&self, input: &Input, output: Option<&Path>) -> Files {
        let path = |path: &Path| path.display().to_string();
        Files {
            left: path(&self.left),
            right: path(&self.right),
            mask: self.mask.as_deref().map(path),
            calibration: input.calibration.as_ref().map(|known| rectification::shown(&known.files)),
            output: output.map(path),
        }
    }

    /// The files that no output may overwrite, each with its name.
    pub(crate) fn inputs<'a>(&'a self, input: &'a Input) -> Vec<(&'static str, &'a Path)> {
        let mut inputs = vec![("LEFT", self.left.as_path()), ("RIGHT", self.right.as_path())];
        inputs.extend(self.mask.as_deref().map(|path| ("the mask", path)));
        let files = input.calibration.iter().flat_map(|known| &known.files);
        inputs.extend(files.map(|path| ("the calibration file", path.as_path())));
        inputs
    }
}

impl Input {
    /// The calibration file and what it holds.
    pub(crate) fn calibration(&self) -> Option<(&Path, &Calibration)> {
        self.calibration.as_ref().map(Known::named)
    }

    /// Says which range was found, if the user gave none.
    pub(crate) fn say_range(&self, sign: Sign) {
        if self.by_matches {
            let DisparityRange { min, max } = sign.range(self.range);
            let text =
                format!("disparities {min} to {max}, by sparse matches; set them with --max-disparity");
            console::say(&text);
        }
    }

    /// Says what is probably wrong with the pair.
    pub(crate) fn warn(&self) {
        // A range that was found does not show what the user knows.
        warn(check::warnings(&self.pair, (!self.by_matches).then_some(self.range)));
    }
}

/// What the calibration in `files` says of images that are rectified.
pub(crate) fn of_rectified_images(files: &[PathBuf]) -> Result<Calibration> {
    let named = |reason: &str| Error::read(rectification::shown(files), reason);
    let known = calibration::read(files)?;
    let calibration = known
        .of_rectified_images()
        .map_err(|e| failure::in_file(e, rectification::shown(files).as_ref(), ""))?;
    Ok(calibration.ok_or_else(|| {
        named("is of images that are not rectified; add --rectify, or give the calibration of the rectified pair")
    })?)
}

/// Says on standard error what is probably wrong.
pub(crate) fn warn(warnings: impl IntoIterator<Item = Warning>) {
    for warning in warnings {
        console::say(&format!("warning: {}", remedy::warning(&warning, &remedy::FLAGS)));
    }
}
