//! A pair with its range and its cameras, as `mrfgs match`, `mrfgs inspect` and `mrfgs sequence` take it.

use std::path::{Path, PathBuf};

use mrfgs::calibration::{self, cameras::StereoCalibration, matrix::Matrix};
use mrfgs::check::{self, Warning};
use mrfgs::depth::Rig;
use mrfgs::image::calib::{Calibration, Unit};
use mrfgs::image::read::Reader;
use mrfgs::image::{Pair, Rect};
use mrfgs::options::DisparityRange;
use mrfgs::rectification::{Doubt, Options, Rectification, Trust};
use mrfgs::region::Region;
use mrfgs::{Error, Matched};

use crate::args::{CameraArgs, CropArgs, Found, ReadingArgs, Search, Sign, shown};
use crate::console;
use crate::failure::{self, Failure, Result};
use crate::matching::Searched;
use crate::outputs::{Also, Files};
use crate::pairs::folder::CALIBRATION;
use crate::pairs::list;
use crate::remedy;

/// The files of a pair, and how they are read.
#[derive(clap::Args)]
pub(crate) struct PairArgs {
    /// Left image, the reference view; or a file with both views, MPO or JPS, without RIGHT
    pub(crate) left: PathBuf,
    /// Right image, of the same size and rectified, so that matches are on the same row
    pub(crate) right: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) search: Search,
    /// Calibration: the range (ndisp of a calib.txt), and the cameras for depth and points; of OpenCV, ROS (two files, each
    /// with --calib), Kalibr, KITTI, Middlebury and others [default: a calib.txt beside LEFT]
    #[arg(long, value_name = "FILE")]
    pub(crate) calib: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) crop: CropArgs,
    /// Image of the size of LEFT: where it is not black, LEFT is ignored and the maps are invalid
    #[arg(long, value_name = "FILE")]
    pub(crate) mask: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
}

/// A calibration: its files, or texts that stand in for them, each with a name.
#[derive(Clone, Copy)]
pub(crate) enum Calib<'a> {
    /// Of these, the images show a part where one is given.
    Files(&'a [PathBuf], &'a CropArgs),
    Texts(&'a [(PathBuf, String)]),
}

impl Calib<'_> {
    fn is_empty(self) -> bool {
        self.names().is_empty()
    }

    /// What messages call it.
    fn names(self) -> Vec<PathBuf> {
        match self {
            Self::Files(files, _) => files.to_vec(),
            Self::Texts(texts) => texts.iter().map(|(name, _)| name.clone()).collect(),
        }
    }

    pub(crate) fn read(self) -> Result<StereoCalibration> {
        match self {
            Self::Files(files, crop) => {
                let known = calibration::read(files)?;
                let Some(part) = &crop.calib_crop else { return Ok(known) };
                known.of_part(part).map_err(|e| match e {
                    Error::Calibration(reason) => {
                        Failure::usage("--calib-crop", format!("{} {reason}", shown(files)))
                    }
                    e => e.into(),
                })
            }
            Self::Texts(texts) => {
                let texts: Vec<_> = texts.iter().map(|(name, text)| (name.as_path(), text.clone())).collect();
                Ok(calibration::of_texts(&texts)?)
            }
        }
    }
}

/// A pair, read.
pub(crate) struct Input {
    pub(crate) pair: Pair,
    pub(crate) range: DisparityRange,
    /// Whether sparse matches gave the range.
    by_matches: bool,
    /// The calibration of the rectified pair.
    calibration: Option<Known>,
    /// Whether the range is one of depths.
    by_depth: bool,
    /// How to give one.
    remedy: &'static str,
    /// What has rectified the pair, where it was not.
    pub(crate) rectification: Option<Rectification>,
}

/// The flag that messages name where the numbers of the cameras are given.
pub(crate) const NUMBERS: &str = "--focal";

/// A calibration of a rectified pair, and where it comes from.
struct Known {
    /// None where flags give its numbers.
    files: Vec<PathBuf>,
    calibration: Calibration,
}

impl Known {
    /// With the file that messages name.
    fn named(&self) -> (&Path, &Calibration) {
        (self.files.first().map_or(Path::new(NUMBERS), PathBuf::as_path), &self.calibration)
    }

    fn is_of_flags(&self) -> bool {
        self.files.is_empty()
    }
}

impl PairArgs {
    /// Reads the images and what the range takes, and the cameras where `cameras` asks for them, unless the user gives their
    /// `numbers`. The user counts disparities by `sign`. With `rectify`, the images are as the cameras took them, and are rectified:
    /// by the calibration, or without one by their own matches.
    pub(crate) fn read(
        &self,
        sign: Sign,
        cameras: bool,
        numbers: Option<&CameraArgs>,
        rectify: Option<&Options>,
    ) -> Result<Input> {
        let reader = match rectify {
            Some(_) => self.reading.raw_reader(&self.calib)?,
            None => self.reading.reader(),
        };
        let read = match rectify {
            Some(_) if !self.calib.is_empty() => raw_views,
            _ => views,
        };
        let pair = read(reader, &self.left, self.right.as_deref(), self.mask.as_deref())?;
        if let Some(options) = rectify.filter(|_| self.calib.is_empty()) {
            let (by, pair) = rectify_alone([&self.left, self.right()], &pair, options)?;
            return Input::rectified_alone(pair, by, &self.search, sign);
        }
        let beside = Some(&*self.left).filter(|_| cameras || self.search.takes_calibration());
        Input::new(pair, &self.search, sign, Calib::Files(&self.calib, &self.crop), numbers, rectify, beside)
    }

    /// Puts what follows the views in its place: see [`behind_views`].
    pub(crate) fn leave(&mut self, next: &mut Option<PathBuf>) -> Result<()> {
        behind_views(&self.left, &mut self.right, next)
    }

    /// The file with the right view.
    fn right(&self) -> &Path {
        self.right.as_deref().unwrap_or(&self.left)
    }

    /// The paths for a record.
    pub(crate) fn files(&self, input: &Input, output: Option<&Path>) -> Files {
        let path = |path: &Path| path.display().to_string();
        Files {
            left: path(&self.left),
            right: path(self.right()),
            mask: self.mask.as_deref().map(path),
            calibration: input.calibration_files(),
            output: output.map(path),
        }
    }

    /// The files that no output may overwrite, each with its name.
    pub(crate) fn inputs<'a>(&'a self, input: &'a Input) -> Vec<(&'static str, &'a Path)> {
        let mut inputs = vec![("LEFT", self.left.as_path())];
        inputs.extend(self.right.as_deref().map(|path| ("RIGHT", path)));
        inputs.extend(self.mask.as_deref().map(|path| ("the mask", path)));
        let files = input.calibration.iter().flat_map(|known| &known.files);
        inputs.extend(files.map(|path| ("the calibration file", path.as_path())));
        inputs
    }
}

impl Input {
    /// `pair` with what the user says of it: the range to `search`, counted by `sign`, the `calib` or the `numbers` of the
    /// cameras, and with `rectify` that it is as the cameras took it. Without both the calibration is that `beside` a left image,
    /// where it is given.
    pub(crate) fn new(
        mut pair: Pair,
        search: &Search,
        sign: Sign,
        calib: Calib,
        numbers: Option<&CameraArgs>,
        rectify: Option<&Options>,
        beside: Option<&Path>,
    ) -> Result<Self> {
        let mut rectification = None;
        let files = calib.names();
        let calibration = if let Some(options) = rectify {
            let by;
            (by, pair) = self::rectify(&calib.read()?, &files, &pair, options)?;
            let calibration = rectification.insert(by).calibration()?;
            Some(Known { files, calibration })
        } else if !calib.is_empty() {
            let calibration = of_rectified(&calib.read()?, &files, pair.size())?;
            Some(Known { files, calibration })
        } else if let Some(calibration) = numbers.and_then(|numbers| numbers.calibration(pair.size())) {
            Some(Known { files, calibration })
        } else if let Some(left) = beside {
            let files = self::beside(left);
            // A part is said of a calibration that is given alone.
            let whole = CropArgs::default();
            let read = |files: &Vec<PathBuf>| of_rectified_images(files, &whole, pair.size());
            let calibration = files.as_ref().map(read).transpose()?;
            files.zip(calibration).map(|(files, calibration)| Known { files, calibration })
        } else {
            None
        };
        let known = calibration.as_ref().map(Known::named);
        let Found { range, by_matches } = search.range(&pair, known, sign)?;
        let remedy = match numbers {
            Some(_) => "give one with --calib, or --focal and --baseline",
            None => "give one with --calib",
        };
        let by_depth = search.takes_cameras().is_some();
        Ok(Self { pair, range, by_matches, calibration, by_depth, remedy, rectification })
    }

    /// `pair`, which `by` has rectified by its own matches, with the range to `search`, counted by `sign`.
    fn rectified_alone(pair: Pair, by: Rectification, search: &Search, sign: Sign) -> Result<Self> {
        let Found { range, by_matches } = search.range(&pair, None, sign)?;
        let (rectification, remedy) = (Some(by), "give one with --calib");
        Ok(Self { pair, range, by_matches, by_depth: false, calibration: None, remedy, rectification })
    }

    /// The files of the calibration, for a record.
    pub(crate) fn calibration_files(&self) -> Option<String> {
        self.calibration.as_ref().filter(|known| !known.is_of_flags()).map(|known| shown(&known.files))
    }

    /// What is matched for the region `part` of the left view.
    ///
    /// # Errors
    /// Where it is not inside the view.
    pub(crate) fn region(&self, part: &Rect) -> Result<Region> {
        let region = Region::new(part.clone(), self.pair.size(), self.range);
        region.map_err(|e| Failure::usage("--roi", e))
    }

    /// The calibration of the rectified pair.
    pub(crate) fn calibration(&self) -> Option<&Calibration> {
        self.calibration.as_ref().map(|known| &known.calibration)
    }

    /// The unit of depths, for people, where there is a calibration.
    pub(crate) fn unit(&self) -> Option<String> {
        self.calibration.as_ref().map(|known| {
            let by = known.named().0;
            unit(known.calibration.unit, (!known.is_of_flags()).then_some(by))
        })
    }

    /// The cameras for the output `word`, if there is one; the left image is `left`.
    pub(crate) fn rig(&self, word: Option<&Also>, left: &Path) -> Result<Option<Rig>> {
        if let Some(known) = self.calibration.as_ref().filter(|known| known.is_of_flags()) {
            let Some(word) = word else {
                if self.by_depth {
                    return Ok(None);
                }
                let reason = "is for depth and points; add --also depth or --also points, or leave it out";
                return Err(Failure::usage("--focal", reason));
            };
            if word.takes_unit() && known.calibration.unit.millimetres().is_none() {
                let reason = "takes the unit of the baseline; give it with the number: --baseline 120mm, 12cm or 0.12m";
                return Err(Failure::usage(word.flag(), reason));
            }
        }
        let known = self.calibration.as_ref().map(Known::named);
        let found = word.map(|word| rig(word, known, left, self.pair.size(), self.remedy)).transpose()?;
        Ok(match self.rectifying() {
            Some(rectifying) => found.map(|rig| rig.rectified_by(&rectifying)),
            None => found,
        })
    }

    /// The rotation from the frame of the left camera to the rectified one, where the pair was rectified.
    pub(crate) fn rectifying(&self) -> Option<Matrix> {
        self.rectification.as_ref().map(|by| by.rotations()[0])
    }

    /// Whether sparse matches have found the range.
    pub(crate) fn has_found_range(&self) -> bool {
        self.by_matches
    }

    /// Says which range was found, if the user gave none; `place` is where, if not in the pair.
    pub(crate) fn say_range(&self, sign: Sign, place: &str) {
        if self.by_matches {
            let DisparityRange { min, max } = sign.range(self.range);
            console::say(&format!(
                "disparities {min} to {max}, by sparse matches{place}; set them with --max-disparity"
            ));
        }
    }

    /// What is searched, where a range that `fits` can be written.
    pub(crate) fn searched(&self, fits: impl Fn(DisparityRange) -> bool) -> Searched<'_> {
        Searched::new(self.range, self.by_matches, fits)
    }

    /// Says so where a range that was found became the wider one of `matched`.
    pub(crate) fn say_wider(&self, matched: &Matched, sign: Sign, place: &str) {
        if matched.range() != self.range {
            let DisparityRange { min, max } = sign.range(matched.range());
            console::say(&format!(
                "disparities {min} to {max} in a second match, because the scene{place} goes beyond the sparse matches"
            ));
        }
    }

    /// Says what is probably wrong with the pair, or with what is matched of it for a `region`.
    pub(crate) fn warn(&self, region: Option<&Region>) {
        if let Some(trust) = self.rectification.as_ref().and_then(Rectification::trust) {
            console::say(&trusted(trust));
        }
        let window = region.map(|region| region.window_of(&self.pair));
        let warnings = self.warnings_of(window.as_ref().unwrap_or(&self.pair), &remedy::FLAGS);
        for warning in &warnings {
            say(warning);
        }
    }

    /// What is probably wrong with the pair and its calibration, in these `words`.
    pub(crate) fn warnings(&self, words: &remedy::Vocabulary) -> Vec<String> {
        self.warnings_of(&self.pair, words)
    }

    fn warnings_of(&self, pair: &Pair, words: &remedy::Vocabulary) -> Vec<String> {
        let mut said = Vec::new();
        let files = self.calibration.as_ref().map_or(&[][..], |known| &known.files);
        if let Some(by) = &self.rectification {
            said.extend(doubts(by, files));
        } else if let Some(known) = &self.calibration {
            said.extend(doubts_of(known.named(), self.pair.size()));
        }
        // A range that was found does not show what the user knows.
        let warnings = check::warnings(pair, (!self.by_matches).then_some(self.range));
        said.extend(warnings.iter().map(|warning| match self.rectification {
            Some(_) => remedy::of_rectified(warning, self.calibration.is_some(), words),
            None => remedy::warning(warning, words),
        }));
        said
    }
}

/// The pair in two files, or in one that holds both views.
pub(crate) fn views(
    reader: Reader,
    left: &Path,
    right: Option<&Path>,
    mask: Option<&Path>,
) -> mrfgs::Result<Pair> {
    match right {
        Some(right) => reader.pair(left, right, mask),
        None => Ok(ordered(reader.both(left, mask)?, mask)),
    }
}

/// The pair in one file. Where that does not say which view is the left one, its matches do, unless a mask of the left view is given.
fn ordered((pair, is_ordered): (Pair, bool), mask: Option<&Path>) -> Pair {
    let is_swapped = || check::warnings(&pair, None).iter().any(|w| matches!(w, Warning::Swapped { .. }));
    if !is_ordered && mask.is_none() && is_swapped() { pair.exchanged() } else { pair }
}

/// Puts what follows the views in its place on a command line. A file `left` that holds both views has no `right` one, so that what follows
/// stands there.
pub(crate) fn behind_views(
    left: &Path,
    right: &mut Option<PathBuf>,
    next: &mut Option<PathBuf>,
) -> Result<()> {
    if next.is_none() && list::holds_both(left) {
        *next = right.take();
    } else if right.is_none() {
        let reason = format!("it is missing, and {} holds one view; .mpo and .jps hold both", left.display());
        return Err(Failure::usage("RIGHT", reason));
    }
    Ok(())
}

/// The raw pair in two files, or in one that holds both views. These may differ in size.
pub(crate) fn raw_views(
    reader: Reader,
    left: &Path,
    right: Option<&Path>,
    mask: Option<&Path>,
) -> mrfgs::Result<Pair> {
    match right {
        Some(right) => reader.raw_pair(left, right, mask),
        None => Ok(ordered(reader.raw_both(left, mask)?, mask)),
    }
}

/// The unit of depths, for people, by a calibration `file` or by flags.
pub(crate) fn unit(unit: Unit, file: Option<&Path>) -> String {
    match (unit, file) {
        (Unit::Unknown, Some(file)) => format!("that of the baseline in {}", file.display()),
        (Unit::Unknown, None) => "that of --baseline".into(),
        (unit, Some(file)) => format!("{}, by {}", unit.name(), file.display()),
        (unit, None) => unit.name().into(),
    }
}

/// The calibration beside an image, where there is one: it counts as one that is given.
pub(crate) fn beside(image: &Path) -> Option<Vec<PathBuf>> {
    let path = image.with_file_name(CALIBRATION);
    path.exists().then(|| vec![path])
}

/// What the calibration in `files` says of images that are rectified and of this `size`.
pub(crate) fn of_rectified_images(
    files: &[PathBuf],
    crop: &CropArgs,
    size: (usize, usize),
) -> Result<Calibration> {
    of_rectified(&Calib::Files(files, crop).read()?, files, size)
}

/// Says on standard error what is probably wrong with the calibration of a rectified pair of this `size`, and with its file.
pub(crate) fn doubt_of(known: (&Path, &Calibration), size: (usize, usize)) {
    doubts_of(known, size).for_each(|doubt| say(&doubt));
}

fn doubts_of(
    (name, calibration): (&Path, &Calibration),
    (width, _): (usize, usize),
) -> impl Iterator<Item = String> {
    let words = if name == Path::new(NUMBERS) { &remedy::NUMBERS } else { &remedy::FLAGS };
    let doubts = Doubt::about(calibration, Some(width)).into_iter();
    doubts.map(move |doubt| format!("{}: {}", name.display(), remedy::doubt(&doubt, words)))
}

/// What the calibration `known`, of these `files`, says of images that are rectified and of this `size`.
fn of_rectified(known: &StereoCalibration, files: &[PathBuf], size: (usize, usize)) -> Result<Calibration> {
    let named = |reason: &str| Error::read(shown(files), reason);
    let calibration =
        known.of_rectified_images(Some(size)).map_err(|e| failure::in_file(e, shown(files).as_ref(), ""))?;
    Ok(calibration.ok_or_else(|| {
        named("is of images that are not rectified; add --rectify, or give the calibration of the rectified pair")
    })?)
}

/// Says on standard error what is probably wrong.
pub(crate) fn warn(warnings: impl IntoIterator<Item = Warning>) {
    warnings.into_iter().for_each(|warning| say(&remedy::warning(&warning, &remedy::FLAGS)));
}

/// Says on standard error what is probably wrong with the calibration of `files`; without one, how far the matches that took its place
/// can be trusted.
pub(crate) fn doubt(by: &Rectification, files: &[PathBuf]) {
    if let Some(trust) = by.trust() {
        console::say(&trusted(trust));
    }
    doubts(by, files).for_each(|doubt| say(&doubt));
}

/// How far a rectification by matches can be trusted, for people.
fn trusted(trust: &Trust) -> String {
    format!("rectified by its own matches, without a scale: {trust}")
}

fn doubts(by: &Rectification, files: &[PathBuf]) -> impl Iterator<Item = String> {
    let of = if files.is_empty() { String::new() } else { format!("{}: ", shown(files)) };
    by.doubts().iter().map(move |doubt| format!("{of}{}", remedy::doubt(doubt, &remedy::FLAGS)))
}

fn say(warning: &str) {
    console::say(&format!("warning: {warning}"));
}

/// Rectifies `pair` by the `calibration` of `files`. Errors name these.
pub(crate) fn rectify(
    calibration: &StereoCalibration,
    files: &[PathBuf],
    pair: &Pair,
    options: &Options,
) -> Result<(Rectification, Pair)> {
    let rectification = Rectification::for_pair(calibration, pair, options).map_err(|e| match e {
        Error::Mismatch(reason) => Error::Mismatch(format!(
            "{}: {reason}: give images of that size, or say by --calib-crop which part of them these show",
            shown(files)
        )),
        e => failure::in_file(e, shown(files).as_ref(), ""),
    })?;
    let pair = rectification.apply(pair)?;
    Ok((rectification, pair))
}

/// Rectifies the `pair` of the files `names` by its own matches. Errors name these.
pub(crate) fn rectify_alone(
    names: [&Path; 2],
    pair: &Pair,
    options: &Options,
) -> Result<(Rectification, Pair)> {
    let by = Rectification::of_pair(pair, options).map_err(|e| match e {
        Error::Rectification(_) => {
            let [left, right] = names.map(Path::display);
            Failure::Failed(format!("{left}, {right}: {}", remedy::error(&e, &remedy::FLAGS)))
        }
        e => e.into(),
    })?;
    let pair = by.apply(pair)?;
    Ok((by, pair))
}

/// The cameras that `word` takes, by the `calibration` file of the pair, whose left image is `left` and has `size`.
///
/// # Errors
/// Where there is no such file, or it is of another size or lacks what depth takes; `remedy` says how to give one.
pub(crate) fn rig(
    word: &Also,
    calibration: Option<(&Path, &Calibration)>,
    left: &Path,
    (width, height): (usize, usize),
    remedy: &str,
) -> Result<Rig> {
    let Some((path, calibration)) = calibration else {
        let reason =
            format!("takes the cameras, and there is no calib.txt beside {}; {remedy}", left.display());
        return Err(Failure::usage(word.flag(), reason));
    };
    let size = (calibration.width.unwrap_or(width as u32), calibration.height.unwrap_or(height as u32));
    if size != (width as u32, height as u32) {
        return Err(Error::Mismatch(format!(
            "{} is for images of {} x {} and {} is {width} x {height}: depth takes the calibration of this size, or --calib-crop, \
             which says the part of them that these show",
            path.display(),
            size.0,
            size.1,
            left.display()
        ))
        .into());
    }
    let rig = Rig::new(calibration).map_err(|e| failure::in_file(e, path, ""))?;
    if word.takes_unit() && rig.unit().millimetres().is_none() {
        let reason = format!(
            "{} does not say the unit of the baseline; add an entry `unit` to it: mm, cm or m",
            path.display()
        );
        return Err(Failure::usage(word.flag(), reason));
    }
    Ok(rig)
}
