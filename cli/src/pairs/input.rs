//! A pair with its range and cameras, for `mrfgs match`, `inspect`, `sequence` and `ros`.

use std::path::{Path, PathBuf};

use mrfgs::calibration::{self, cameras::StereoCalibration, matrix::Matrix};
use mrfgs::check::{self, Warning};
use mrfgs::depth::Rig;
use mrfgs::image::calib::{Calibration, Unit};
use mrfgs::image::read::Reader;
use mrfgs::image::{Image, Pair, Rect};
use mrfgs::options::DisparityRange;
use mrfgs::rectification::{Doubt, Options, Rectification, Trust};
use mrfgs::region::Region;
use mrfgs::{Error, Matched};
use mrfgs_ros::recording::Recording;

use crate::args::{CameraArgs, CameraNeed, CropArgs, ReadingArgs, ResolvedRange, Search, Sign, shown};
use crate::console;
use crate::failure::{self, Failure, Result};
use crate::ffmpeg;
use crate::matching::SearchSpace;
use crate::outputs::Files;
use crate::pairs::folder::CALIBRATION;
use crate::pairs::large::LargePair;
use crate::pairs::list;
use crate::pairs::views::Views;
use crate::remedy;

/// The files of a pair, and how to read them.
#[derive(clap::Args)]
pub(crate) struct PairArgs {
    /// Left image, the reference view; or one file with both views (MPO, JPS), without RIGHT
    pub(crate) left: PathBuf,
    /// Right image, of the same size; rectified, so that matching points are in the same row, unless --rectify is given
    pub(crate) right: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) search: Search,
    /// Calibration, for the range (ndisp of a calib.txt) and for depth and points. OpenCV, ROS, Kalibr, KITTI, Middlebury and others; each
    /// of several files with its own --calib [default: a calib.txt beside LEFT]
    #[arg(long, value_name = "FILE")]
    pub(crate) calib: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) crop: CropArgs,
    /// Mask of the size of LEFT: pixels that are not black are ignored and invalid in the maps
    #[arg(long, value_name = "FILE")]
    pub(crate) mask: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
}

/// A calibration: files, or texts with names that replace them.
#[derive(Clone, Copy)]
pub(crate) enum Calib<'a> {
    /// Calibration files, with the crop that the images show.
    Files(&'a [PathBuf], &'a CropArgs),
    Texts(&'a [(PathBuf, String)]),
}

impl Calib<'_> {
    fn is_empty(self) -> bool {
        self.names().is_empty()
    }

    /// The names for messages.
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

/// A pair with its range and calibration.
pub(crate) struct Input<V = Pair> {
    pub(crate) pair: V,
    /// (width, height) of the whole views in pixels.
    pub(crate) size: (usize, usize),
    pub(crate) range: DisparityRange,
    /// Whether the range was estimated from sparse matches.
    by_matches: bool,
    /// The calibration of the rectified pair.
    calibration: Option<KnownCalibration>,
    /// Whether the range was given as depths.
    by_depth: bool,
    /// How to give a calibration, for messages.
    remedy: &'static str,
    /// The rectification applied to the pair, if there was one.
    pub(crate) rectification: Option<Rectification>,
}

/// Stands for the file name in messages if flags give the cameras.
pub(crate) const NUMBERS: &str = "--focal";

/// A calibration of a rectified pair, and its origin.
struct KnownCalibration {
    /// Empty if flags give the cameras.
    files: Vec<PathBuf>,
    calibration: Calibration,
}

impl KnownCalibration {
    /// The calibration of rectified images of this `size`: that of `calib`, else of the flags (`numbers`), else of the calib.txt `beside`
    /// the left image if given.
    fn of_rectified(
        calib: Calib,
        numbers: Option<&CameraArgs>,
        beside: Option<&Path>,
        size: (usize, usize),
    ) -> Result<Option<Self>> {
        let files = calib.names();
        Ok(if !calib.is_empty() {
            let calibration = of_rectified(&calib.read()?, &files, size)?;
            Some(Self { files, calibration })
        } else if let Some(calibration) = numbers.and_then(|numbers| numbers.calibration(size)) {
            Some(Self { files, calibration })
        } else if let Some(left) = beside {
            let files = self::beside(left);
            // --calib-crop only applies to --calib.
            let whole = CropArgs::default();
            let read = |files: &Vec<PathBuf>| of_rectified_images(files, &whole, size);
            let calibration = files.as_ref().map(read).transpose()?;
            files.zip(calibration).map(|(files, calibration)| Self { files, calibration })
        } else {
            None
        })
    }

    /// The calibration with the file name for messages.
    fn named(&self) -> (&Path, &Calibration) {
        (self.files.first().map_or(Path::new(NUMBERS), PathBuf::as_path), &self.calibration)
    }

    fn is_of_flags(&self) -> bool {
        self.files.is_empty()
    }
}

impl PairArgs {
    /// Reads the images, the range and, if `cameras` asks for them, the cameras, unless flags (`numbers`) give those. The user counts
    /// disparities by `sign`. With `rectify`, raw images are rectified by the calibration, or without one from their own matches.
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
        let beside = self.beside(cameras);
        Input::new(pair, &self.search, sign, Calib::Files(&self.calib, &self.crop), numbers, rectify, beside)
    }

    /// Like [`Self::read`], for rectified images that are not read yet: their `views` read what is needed.
    pub(crate) fn of_views<V: Views>(
        &self,
        views: V,
        sign: Sign,
        cameras: bool,
        numbers: Option<&CameraArgs>,
    ) -> Result<Input<V>> {
        let calib = Calib::Files(&self.calib, &self.crop);
        let calibration = KnownCalibration::of_rectified(calib, numbers, self.beside(cameras), views.size())?;
        Input::with_range(views, &self.search, sign, calibration, numbers, None)
    }

    /// The left image, if a calib.txt beside it counts.
    fn beside(&self, cameras: bool) -> Option<&Path> {
        Some(&*self.left).filter(|_| cameras || self.search.takes_calibration())
    }

    /// Assigns the positional arguments: see [`behind_views`].
    pub(crate) fn leave(&mut self, next: &mut Option<PathBuf>) -> Result<()> {
        behind_views(&self.left, &mut self.right, next)
    }

    /// The file with the right view.
    fn right(&self) -> &Path {
        self.right.as_deref().unwrap_or(&self.left)
    }

    /// The paths for a record.
    pub(crate) fn files<V>(&self, input: &Input<V>, output: Option<&Path>) -> Files {
        let path = |path: &Path| path.display().to_string();
        Files {
            left: path(&self.left),
            right: path(self.right()),
            mask: self.mask.as_deref().map(path),
            calibration: input.calibration_files(),
            prior: None,
            output: output.map(path),
        }
    }

    /// The files that no output may overwrite, each with its name.
    pub(crate) fn inputs<'a, V>(&'a self, input: &'a Input<V>) -> Vec<(&'static str, &'a Path)> {
        let mut inputs = vec![("LEFT", self.left.as_path())];
        inputs.extend(self.right.as_deref().map(|path| ("RIGHT", path)));
        inputs.extend(self.mask.as_deref().map(|path| ("the mask", path)));
        let files = input.calibration.iter().flat_map(|known| &known.files);
        inputs.extend(files.map(|path| ("the calibration file", path.as_path())));
        inputs
    }
}

impl Input {
    /// Resolves the range to `search` (counted by `sign`) and the calibration of `pair`: that of `calib`, else of the flags (`numbers`),
    /// else of the calib.txt `beside` the left image if given. With `rectify`, rectifies the pair by `calib`.
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
            Some(KnownCalibration { files, calibration })
        } else {
            KnownCalibration::of_rectified(calib, numbers, beside, pair.size())?
        };
        Self::with_range(pair, search, sign, calibration, numbers, rectification)
    }

    /// The input for a pair that `by` rectified without a calibration, with the range to `search`, counted by `sign`.
    pub(crate) fn rectified_alone(
        pair: Pair,
        by: Rectification,
        search: &Search,
        sign: Sign,
    ) -> Result<Self> {
        Self::with_range(pair, search, sign, None, None, Some(by))
    }
}

impl<V: Views> Input<V> {
    /// The input for views with this `calibration` and `rectification`, and the range to `search`, counted by `sign`.
    fn with_range(
        pair: V,
        search: &Search,
        sign: Sign,
        calibration: Option<KnownCalibration>,
        numbers: Option<&CameraArgs>,
        rectification: Option<Rectification>,
    ) -> Result<Self> {
        let (known, size) = (calibration.as_ref().map(KnownCalibration::named), pair.size());
        let ResolvedRange { range, by_matches } =
            search.range(size.0, known, sign, |doffs| Ok(pair.range(doffs)?))?;
        let remedy = match numbers {
            Some(_) => "give one with --calib, or --focal and --baseline",
            None => "give one with --calib",
        };
        let by_depth = search.takes_cameras().is_some();
        Ok(Self { pair, size, range, by_matches, calibration, by_depth, remedy, rectification })
    }
}

impl<V> Input<V> {
    /// The same input with other views of the same pair, such as a window of them.
    pub(crate) fn with_views<W>(self, change: impl FnOnce(V) -> Result<W>) -> Result<Input<W>> {
        let Self { pair, size, range, by_matches, calibration, by_depth, remedy, rectification } = self;
        Ok(Input {
            pair: change(pair)?,
            size,
            range,
            by_matches,
            calibration,
            by_depth,
            remedy,
            rectification,
        })
    }

    /// The files of the calibration, for a record.
    pub(crate) fn calibration_files(&self) -> Option<String> {
        self.calibration.as_ref().filter(|known| !known.is_of_flags()).map(|known| shown(&known.files))
    }

    /// The region to match for the crop `part` of the left view.
    ///
    /// # Errors
    /// If it is not inside the view.
    pub(crate) fn region(&self, part: &Rect) -> Result<Region> {
        let region = Region::new(part.clone(), self.size, self.range);
        region.map_err(|e| Failure::usage("--roi", e))
    }

    /// The calibration of the rectified pair.
    pub(crate) fn calibration(&self) -> Option<&Calibration> {
        self.calibration.as_ref().map(|known| &known.calibration)
    }

    /// The unit of depths for messages; `None` without a calibration.
    pub(crate) fn unit(&self) -> Option<String> {
        self.calibration.as_ref().map(|known| {
            let files = shown(&known.files);
            unit(known.calibration.unit, (!known.is_of_flags()).then_some(files.as_ref()))
        })
    }

    /// The cameras, if something needs them; `left` is the path of the left image.
    pub(crate) fn rig(&self, need: Option<&CameraNeed>, left: &Path) -> Result<Option<Rig>> {
        if let Some(known) = self.calibration.as_ref().filter(|known| known.is_of_flags()) {
            let Some(need) = need else {
                if self.by_depth {
                    return Ok(None);
                }
                let reason =
                    "is only used for depth and points; add --also depth or --also points, or remove it";
                return Err(Failure::usage("--focal", reason));
            };
            if need.unit && known.calibration.unit.millimetres().is_none() {
                let reason = "needs the unit of the baseline; add it: --baseline 120mm, 12cm or 0.12m";
                return Err(Failure::usage(&need.flag, reason));
            }
        }
        let known = self.calibration.as_ref().map(KnownCalibration::named);
        let found = match need {
            Some(need) if need.optional => {
                known.and_then(|(_, calibration)| known_rig(calibration, self.size))
            }
            Some(need) => Some(rig(need, known, left, self.size, self.remedy)?),
            None => None,
        };
        Ok(match self.rectifying() {
            Some(rectifying) => found.map(|rig| rig.rectified_by(&rectifying)),
            None => found,
        })
    }

    /// The rotation from the left camera's frame to the rectified frame, if the pair was rectified.
    pub(crate) fn rectifying(&self) -> Option<Matrix> {
        self.rectification.as_ref().map(|by| by.rotations()[0])
    }

    /// The cameras with points in the frame of the left camera as it took the image, even if the pair was rectified.
    pub(crate) fn as_taken(&self, rig: Option<Rig>) -> Option<Rig> {
        match self.rectifying() {
            Some(rectifying) => rig.map(|rig| rig.in_original_frame(&rectifying)),
            None => rig,
        }
    }

    /// Whether sparse matches have found the range.
    pub(crate) fn has_found_range(&self) -> bool {
        self.by_matches
    }

    /// Prints the range if it was estimated; `place` says in which frame.
    pub(crate) fn say_range(&self, sign: Sign, place: &str) {
        if self.by_matches {
            let DisparityRange { min, max } = sign.range(self.range);
            console::say(&format!(
                "disparities {min} to {max}, estimated from the images{place}; set them with --max-disparity"
            ));
        }
    }

    /// The search space; it may be widened to a range that `fits` the outputs.
    pub(crate) fn searched(&self, fits: impl Fn(DisparityRange) -> bool) -> SearchSpace<'_> {
        SearchSpace::new(self.range, self.by_matches, fits)
    }

    /// Prints the range if the match has widened it; `place` says in which frame.
    pub(crate) fn say_wider(&self, matched: &Matched, sign: Sign, place: &str) {
        if matched.range() != self.range {
            let DisparityRange { min, max } = sign.range(matched.range());
            console::say(&format!(
                "disparities {min} to {max} in a second match, because the scene{place} goes beyond the estimate"
            ));
        }
    }

    /// Prints `warnings` about the pair, after those about its calibration.
    fn say_all(&self, warnings: &[Warning]) {
        if let Some(trust) = self.rectification.as_ref().and_then(Rectification::trust) {
            console::say(&trusted(trust));
        }
        for warning in &self.in_words(warnings, &remedy::FLAGS) {
            say(warning);
        }
    }

    /// Warnings about the calibration, and `warnings` about the pair, in the vocabulary `words`.
    fn in_words(&self, warnings: &[Warning], words: &remedy::Vocabulary) -> Vec<String> {
        let mut said = Vec::new();
        let files = self.calibration.as_ref().map_or(&[][..], |known| &known.files);
        if let Some(by) = &self.rectification {
            said.extend(doubts(by, files));
        } else if let Some(known) = &self.calibration {
            said.extend(doubts_of(known.named(), self.size));
        }
        said.extend(warnings.iter().map(|warning| match self.rectification {
            Some(_) => remedy::of_rectified(warning, self.calibration.is_some(), words),
            None => remedy::warning(warning, words),
        }));
        said
    }

    /// The range, if the user chose it: an estimated one says nothing about the pair.
    fn chosen(&self) -> Option<DisparityRange> {
        (!self.by_matches).then_some(self.range)
    }
}

impl Input {
    /// Prints warnings about the pair, or about its `region`.
    pub(crate) fn warn(&self, region: Option<&Region>) {
        let window = region.map(|region| region.window_of(&self.pair));
        self.say_all(&check::warnings(window.as_ref().unwrap_or(&self.pair), self.chosen()));
    }

    /// Warnings about the pair and its calibration, in the vocabulary `words`.
    pub(crate) fn warnings(&self, words: &remedy::Vocabulary) -> Vec<String> {
        self.in_words(&check::warnings(&self.pair, self.chosen()), words)
    }
}

impl Input<LargePair> {
    /// Prints warnings about the pair.
    pub(crate) fn warn(&self) -> Result<()> {
        self.say_all(&self.pair.warnings(self.chosen())?);
        Ok(())
    }
}

/// Reads a pair from two files, or from one file with both views.
pub(crate) fn views(
    reader: Reader,
    left: &Path,
    right: Option<&Path>,
    mask: Option<&Path>,
) -> mrfgs::Result<Pair> {
    match right {
        Some(right) => reader.pair(left, right, mask).map_err(|e| turned(reader, [left, right], e)),
        None => Ok(ordered(reader.both(left, mask)?, mask)),
    }
}

/// Adds the remedy to the `error` of a pair, if one of its images lies on its side: phones say so in a tag.
fn turned(reader: Reader, files: [&Path; 2], error: Error) -> Error {
    let [left, right] = files.map(|file| reader.size(file));
    match (error, left, right) {
        (Error::Mismatch(reason), Ok((w, h)), Ok(right)) if w != h && right == (h, w) => {
            let remedy = "turn them with --orient, or add --rectify to photos taken by hand";
            Error::Mismatch(format!("{reason}; {remedy}"))
        }
        (error, ..) => error,
    }
}

/// The pair in one file. Where that does not say which view is the left one, its matches do, unless a mask of the left view is given.
fn ordered((pair, is_ordered): (Pair, bool), mask: Option<&Path>) -> Pair {
    let is_swapped = || check::warnings(&pair, None).iter().any(|w| matches!(w, Warning::Swapped { .. }));
    if !is_ordered && mask.is_none() && is_swapped() { pair.exchanged() } else { pair }
}

/// The left image alone, for its colours.
pub(crate) fn left(reader: Reader, path: &Path) -> Result<Image> {
    let raster = reader.raster(path)?;
    // A pair of frames has the only way from one to an image.
    Ok(Pair::of_frames(raster.clone(), raster)?.left().clone())
}

/// Refuses the file `path` of another (width, height) than the map in `map`.
pub(crate) fn check_view(
    path: &Path,
    (w, h): (usize, usize),
    map: &Path,
    (width, height): (usize, usize),
) -> Result<()> {
    if (w, h) == (width, height) {
        return Ok(());
    }
    let [path, map] = [path, map].map(Path::display);
    let reason = format!("{path} is {w} x {h} but {map} is {width} x {height}: give files of the same view");
    Err(Error::Mismatch(reason).into())
}

/// Assigns the positional arguments after LEFT. If `left` holds both views there is no RIGHT, so the argument in its place is `next`.
pub(crate) fn behind_views(
    left: &Path,
    right: &mut Option<PathBuf>,
    next: &mut Option<PathBuf>,
) -> Result<()> {
    if next.is_none() && list::holds_both(left) {
        *next = right.take();
    } else if right.is_none() {
        return Err(without_right(left));
    }
    Ok(())
}

/// There is no image beside `left`, which holds one view.
pub(crate) fn without_right(left: &Path) -> Failure {
    let is_film = ffmpeg::writes(left) || left.extension().is_some_and(|end| end.eq_ignore_ascii_case("y4m"));
    let holds_many = is_film || Recording::is(left);
    let left = left.display();
    if holds_many {
        let reason = format!("{left} holds many pairs; match them with `mrfgs sequence {left} maps`");
        return Failure::usage("LEFT", reason);
    }
    let reason =
        format!("missing; {left} holds one view by its name (those of files with both end in .mpo or .jps)");
    Failure::usage("RIGHT", reason)
}

/// Reads a raw pair from two files, which may differ in size, or from one file with both views.
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

/// The unit of depths for messages, given by a calibration `file` or by flags.
pub(crate) fn unit(unit: Unit, file: Option<&Path>) -> String {
    match (unit, file) {
        (Unit::Unknown, Some(file)) => format!("same as the baseline in {}", file.display()),
        (Unit::Unknown, None) => "same as --baseline".into(),
        (unit, Some(file)) => format!("{}, from {}", unit.name(), file.display()),
        (unit, None) => unit.name().into(),
    }
}

/// The calib.txt beside an image, if it exists. It is treated as if given by --calib.
pub(crate) fn beside(image: &Path) -> Option<Vec<PathBuf>> {
    let path = image.with_file_name(CALIBRATION);
    path.exists().then(|| vec![path])
}

/// The calibration in `files` for rectified images of this `size`.
pub(crate) fn of_rectified_images(
    files: &[PathBuf],
    crop: &CropArgs,
    size: (usize, usize),
) -> Result<Calibration> {
    of_rectified(&Calib::Files(files, crop).read()?, files, size)
}

/// Prints warnings about the calibration of a rectified pair of this `size`, and about its file.
pub(crate) fn doubt_of(known: (&Path, &Calibration), size: (usize, usize)) {
    doubts_of(known, size).for_each(|doubt| say(&doubt));
}

fn doubts_of(
    (name, calibration): (&Path, &Calibration),
    (width, _): (usize, usize),
) -> impl Iterator<Item = String> {
    let words = words_of(name);
    let doubts = Doubt::about(calibration, Some(width)).into_iter();
    doubts.map(move |doubt| format!("{}: {}", name.display(), remedy::doubt(&doubt, words)))
}

/// The part of the calibration `known` (from `files`) that applies to rectified images of this `size`.
fn of_rectified(known: &StereoCalibration, files: &[PathBuf], size: (usize, usize)) -> Result<Calibration> {
    let named = |reason: &str| Error::read(shown(files), reason);
    let calibration =
        known.of_rectified_images(Some(size)).map_err(|e| failure::in_file(e, shown(files).as_ref(), ""))?;
    Ok(calibration.ok_or_else(|| {
        named("describes images that are not rectified; add --rectify, or give the calibration of the rectified pair")
    })?)
}

/// Prints warnings.
pub(crate) fn warn(warnings: impl IntoIterator<Item = Warning>) {
    warnings.into_iter().for_each(|warning| say(&remedy::warning(&warning, &remedy::FLAGS)));
}

/// Prints doubts about the calibration in `files`; without one, also how reliable the rectification from matches is.
pub(crate) fn doubt(by: &Rectification, files: &[PathBuf]) {
    if let Some(trust) = by.trust() {
        console::say(&trusted(trust));
    }
    doubts(by, files).for_each(|doubt| say(&doubt));
}

/// How reliable a rectification from matches is, for messages.
fn trusted(trust: &Trust) -> String {
    format!("rectified without a calibration, so there is no scale: {trust}")
}

fn doubts(by: &Rectification, files: &[PathBuf]) -> impl Iterator<Item = String> {
    let of = if files.is_empty() { String::new() } else { format!("{}: ", shown(files)) };
    let words = files.first().map_or(&remedy::FLAGS, |file| words_of(file));
    by.doubts().iter().map(move |doubt| format!("{of}{}", remedy::doubt(doubt, words)))
}

/// The words for a calibration of this `name`: that of a flag, a file, or a topic, which is no file.
fn words_of(name: &Path) -> &'static remedy::Vocabulary {
    match name {
        name if name == Path::new(NUMBERS) => &remedy::NUMBERS,
        name if name.exists() => &remedy::FLAGS,
        _ => &remedy::MESSAGES,
    }
}

fn say(warning: &str) {
    console::say(&format!("warning: {warning}"));
}

/// Rectifies `pair` by the `calibration` in `files`, which errors name.
pub(crate) fn rectify(
    calibration: &StereoCalibration,
    files: &[PathBuf],
    pair: &Pair,
    options: &Options,
) -> Result<(Rectification, Pair)> {
    let rectification = Rectification::for_pair(calibration, pair, options).map_err(|e| match e {
        Error::Mismatch(reason) => Error::Mismatch(format!(
            "{}: {reason}: give images of that size, or say with --calib-crop which part of them these show",
            shown(files)
        )),
        e => failure::in_file(e, shown(files).as_ref(), ""),
    })?;
    let pair = rectification.apply(pair)?;
    Ok((rectification, pair))
}

/// Rectifies `pair` without a calibration, from its own matches. Errors name the files `names`.
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

/// The cameras of a `calibration`, if it is complete and for images of this size.
pub(crate) fn known_rig(calibration: &Calibration, (width, height): (usize, usize)) -> Option<Rig> {
    let is_of_size = |known: Option<u32>, size: usize| known.is_none_or(|known| known as usize == size);
    let fits = is_of_size(calibration.width, width) && is_of_size(calibration.height, height);
    fits.then(|| Rig::new(calibration).ok()).flatten()
}

/// The cameras for what needs them, from the `calibration` of the pair, whose left image is `left` and has this size.
///
/// # Errors
/// If there is no calibration, or it is for another size or lacks values that depth needs; `remedy` says how to give one.
pub(crate) fn rig(
    need: &CameraNeed,
    calibration: Option<(&Path, &Calibration)>,
    left: &Path,
    (width, height): (usize, usize),
    remedy: &str,
) -> Result<Rig> {
    let Some((path, calibration)) = calibration else {
        let reason =
            format!("needs camera values, but there is no calib.txt beside {}; {remedy}", left.display());
        return Err(Failure::usage(&need.flag, reason));
    };
    let size = (calibration.width.unwrap_or(width as u32), calibration.height.unwrap_or(height as u32));
    if size != (width as u32, height as u32) {
        return Err(Error::Mismatch(format!(
            "{} is for images of {} x {} but {} is {width} x {height}: give the calibration of this size, or say with --calib-crop \
             which part of them these show",
            path.display(),
            size.0,
            size.1,
            left.display()
        ))
        .into());
    }
    let rig = Rig::new(calibration).map_err(|e| failure::in_file(e, path, ""))?;
    if need.unit && rig.unit().millimetres().is_none() {
        let reason = format!(
            "{} lacks the unit of the baseline; add an entry `unit` to it: mm, cm or m",
            path.display()
        );
        return Err(Failure::usage(&need.flag, reason));
    }
    Ok(rig)
}
