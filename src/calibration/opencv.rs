//! OpenCV's stereo calibrations in YAML or XML, by the names that it and most other programs use.

use super::cameras::{Pose, RectifiedViews, StereoCalibration};
use super::lens::{Distortion, Lens, RadialTangential};
use super::matrix::{IDENTITY, Matrix, length, rotation};
use super::models::Model;
use super::node::{Entries, Entry};
use crate::error::Result;
use crate::image::calib::{Camera, Unit};
use crate::text::letters_apart;

// In lower case and without `_`, as for `Entries::find`.
const CAMERA: [&str; 2] = [
    "k1 m1 cameramatrix1 cameramatrixleft leftcameramatrix kleft kl leftk mleft cameramatrixl ml mtxl mtx1 leftmtx mtxleft left.k",
    "k2 m2 cameramatrix2 cameramatrixright rightcameramatrix kright kr rightk mright cameramatrixr mr mtxr mtx2 rightmtx mtxright right.k",
];
const DISTORTION: [&str; 2] = [
    "d1 distcoeffs1 distortioncoefficients1 dist1 distcoeffsleft leftdistcoeffs dleft dl distcoeffsl distcoeffl distl distleft leftdist leftdistortion distortionleft left.d",
    "d2 distcoeffs2 distortioncoefficients2 dist2 distcoeffsright rightdistcoeffs dright dr distcoeffsr distcoeffr distr distright rightdist rightdistortion distortionright right.d",
];
// The names for a single camera, without a number.
const ALONE: &str = "k cameramatrix m intrinsicmatrix mtx";
const DISTORTION_ALONE: &str = "d distortioncoefficients distcoeffs dist";
pub(super) const ROTATION: &str = "r rotation rotationmatrix stereor rot";
pub(super) const TRANSLATION: &str = "t translation translationvector trans stereot trns";
const RECTIFICATION: [&str; 2] =
    ["r1 rectification1 rleft rl rectl left.r", "r2 rectification2 rright rr rectr right.r"];
const PROJECTION: [&str; 2] = [
    "p1 projection1 pleft pl projmatrixl projmatl left.p",
    "p2 projection2 pright pr projmatrixr projmatr right.p",
];
const SIZE: &str = "imagesize size imgsize resolution";
const NEW_SIZE: &str = "newimagesize newsize rectifiedsize rectifiedimagesize";
const WIDTH: &str = "imagewidth width left.width";
const HEIGHT: &str = "imageheight height left.height";
const XI: [&str; 2] = ["xi1 xileft xil", "xi2 xiright xir"];
const FISHEYE: &str = "fisheye fisheyemodel usefisheye";
const MODEL: [&str; 2] = ["distortionmodel distortiontype lensmodel", "cameramodel"];
const Q: &str = "q disparitytodepth disptodepth";
const UNIT: &str = "unit units";
/// Optional entries, whose misspelling would otherwise go unnoticed.
const OPTIONAL: [&str; 5] = ["fisheye", "unit", "imagesize", "newimagesize", "distortionmodel"];

/// Whether there is a camera matrix of a pair.
pub(super) fn has_lens(entries: &Entries) -> bool {
    CAMERA.iter().any(|names| entries.find(names).is_some())
}

/// Whether the entries are OpenCV's, by a matrix of a camera. A short name alone may mean something else.
pub(super) fn is(entries: &Entries) -> bool {
    let mut all =
        CAMERA.iter().chain(&PROJECTION).chain(&DISTORTION).flat_map(|names| entries.find_all(names));
    all.any(|entry| entry.is_matrix() || entry.name().len() > 4 && entry.is_compound())
}

/// Whether there are R and T, as in OpenCV's stereo calibrations.
pub(super) fn has_pose(entries: &Entries) -> bool {
    let has = |names: &str| entries.find(names).is_some_and(|entry| entry.is_compound());
    has(ROTATION) && has(TRANSLATION)
}

/// The names of all entries that are read.
fn known() -> impl Iterator<Item = &'static str> {
    let pairs = [CAMERA, DISTORTION, RECTIFICATION, PROJECTION, XI, MODEL];
    let others = [ROTATION, TRANSLATION, SIZE, NEW_SIZE, WIDTH, HEIGHT, FISHEYE, Q, UNIT];
    pairs.into_iter().flatten().chain(others)
}

/// Whether each of these files has an entry that none of the others has.
pub(super) fn needs_all(files: &[Entries]) -> bool {
    let is_needed = |i: usize| {
        known().any(|names| {
            files.iter().enumerate().all(|(other, file)| file.find(names).is_some() == (other == i))
        })
    };
    (0..files.len()).all(is_needed)
}

pub(super) fn read(entries: &Entries) -> Result<StereoCalibration> {
    known().try_for_each(|names| entries.agree(names))?;
    rightly_spelt(entries)?;
    let (size, unit) = (size(entries)?, unit(entries)?);
    let mut calibration = StereoCalibration { size, unit, ..StereoCalibration::default() };
    let has = |names: &str| entries.find(names).is_some();
    let stored = PROJECTION.iter().any(|names| has(names));
    if has_lens(entries) || !stored {
        calibration.lenses = Some([lens(entries, 0)?, lens(entries, 1)?]);
    }
    if stored {
        calibration.views = Some(views(entries)?);
    }
    if has(ROTATION) || has(TRANSLATION) || !stored {
        calibration.pose = Some(pose(entries)?);
    }
    check_baseline(entries, &calibration)?;
    Ok(calibration)
}

/// An error if a name is nearly that of an optional entry. Longer names that contain one are accepted.
fn rightly_spelt(entries: &Entries) -> Result<()> {
    let is_known = |name: &str| known().any(|names| names.split(' ').any(|known| known == name));
    let is_near = |name: &str, known: &str| {
        let most = if known.len() > 4 { 2 } else { 1 };
        !name.starts_with(known) && !name.ends_with(known) && letters_apart(name, known) <= most
    };
    for name in entries.names().filter(|name| !is_known(name)) {
        if let Some(meant) = OPTIONAL.into_iter().find(|known| is_near(&name, known)) {
            let entry = entries.require(&name, &name, "")?;
            return Err(entry.error(format_args!(
                "is no entry that is known; {meant} may be meant: correct it, or leave it out"
            )));
        }
    }
    Ok(())
}

/// T, P2 and Q each give the baseline; an error if they differ.
fn check_baseline(entries: &Entries, calibration: &StereoCalibration) -> Result<()> {
    // Tolerates the rounding of files.
    const ROUNDING: f64 = 0.01;
    let mut said: Vec<(Entry, f64)> = Vec::new();
    let mut put =
        |names: &str, baseline: f64| said.extend(entries.find(names).map(|entry| (entry, baseline)));
    if let Some(pose) = &calibration.pose {
        put(TRANSLATION, length(pose.translation));
    }
    if let Some(RectifiedViews { translation: [x, y], .. }) = calibration.views {
        put(PROJECTION[1], length([x, y, 0.0]));
    }
    if let Some(entry) = entries.find(Q) {
        let inverse = entry.matrix::<4, 4>()?[3][2].abs();
        if inverse == 0.0 {
            return Err(entry.wrong("1 / baseline in its last row, other than 0"));
        }
        put(Q, 1.0 / inverse);
    }
    let Some(((first, baseline), others)) = said.split_first() else { return Ok(()) };
    match others.iter().find(|(_, other)| (other / baseline - 1.0).abs() > ROUNDING) {
        Some((entry, other)) => Err(entry.error(format_args!(
            "says a baseline of {} and {} one of {}, which differ by a factor of {}; give both in one unit, or leave out the \
             wrong one",
            digits(*other),
            first.name(),
            digits(*baseline),
            digits((other / baseline).max(baseline / other))
        ))),
        None => Ok(()),
    }
}

/// A number with four significant digits, for messages.
fn digits(number: f64) -> String {
    let before = libm::log10(number).floor() as i32;
    match usize::try_from(3 - before) {
        Ok(after @ 0..9) => format!("{number:.after$}"),
        _ => format!("{number:.3e}"),
    }
}

/// The unit that the entries state.
pub(super) fn unit(entries: &Entries) -> Result<Unit> {
    let Some(unit) = entries.find(UNIT) else { return Ok(Unit::Unknown) };
    unit.word()?.parse().map_err(|expected: &str| unit.wrong(expected))
}

/// The size of the images.
pub(super) fn size(entries: &Entries) -> Result<Option<(usize, usize)>> {
    match (entries.find(SIZE), entries.find(WIDTH), entries.find(HEIGHT)) {
        (Some(size), ..) => size.size().map(Some),
        (None, Some(width), Some(height)) => Ok(Some((width.count()?, height.count()?))),
        _ => Ok(None),
    }
}

fn lens(entries: &Entries, view: usize) -> Result<Lens> {
    let called = ["K1", "K2"][view];
    let matrix = entries.require(CAMERA[view], called, "the matrix [f 0 cx; 0 f cy; 0 0 1] of the camera")?;
    let (focal_length, principal_point) = camera(&matrix)?;
    let called = ["D1", "D2"][view];
    let expected = "the distortion of the lens, 0 0 0 0 for none";
    let entry = entries.require(DISTORTION[view], called, expected)?;
    let expected = "the coefficients of the distortion";
    let fisheye = is_fisheye(entries)?;
    let distortion = match entries.find(XI[view]) {
        // OpenCV's module omnidir.
        Some(xi) => Distortion::Unified { xi: xi.number()?, then: radial_tangential(&entry, expected)? },
        None => distortion(&entry, expected, fisheye)?,
    };
    Lens::new(focal_length, principal_point, distortion).map_err(|_| matrix.wrong("a camera with its lens"))
}

/// Whether there is the camera matrix of a single camera.
pub(super) fn has_lens_alone(entries: &Entries) -> bool {
    entries.find_all(ALONE).any(|entry| entry.is_matrix())
}

/// The lens of a single camera, whose entries have no number.
pub(super) fn lens_alone(entries: &Entries) -> Result<Lens> {
    let expected =
        "the matrix [f 0 cx; 0 f cy; 0 0 1] of one camera; or give Kalibr's chain, or the file of an OAK";
    let matrix = entries.require(ALONE, "K", expected)?;
    let (focal_length, principal_point) = camera(&matrix)?;
    let expected = "the distortion of the lens, 0 0 0 0 for none";
    let entry = entries.require(DISTORTION_ALONE, "D", expected)?;
    let distortion = distortion(&entry, expected, is_fisheye(entries)?)?;
    Lens::new(focal_length, principal_point, distortion).map_err(|_| matrix.wrong("a camera with its lens"))
}

/// Whether the lenses are fisheyes. OpenCV's files do not tell by themselves; see the guide.
pub(super) fn is_fisheye(entries: &Entries) -> Result<bool> {
    let mut said: Option<(Entry, bool)> = None;
    let flag = entries.find(FISHEYE).map(|entry| fisheye_flag(&entry).map(|is| (entry, Some(is))));
    let models = MODEL.iter().filter_map(|names| entries.find(names));
    let models = models.map(|entry| {
        let model = Model::of(&entry)?;
        if matches!(model, Model::DoubleSphere | Model::ExtendedUnified | Model::FieldOfView) {
            return Err(entry.wrong("a lens model of OpenCV; others are read in the form of Kalibr"));
        }
        if model == Model::Unified && entries.find(XI[0]).is_none() {
            return Err(entry.error("takes xi1 and xi2 beside D1 and D2, which are missing"));
        }
        Ok((entry, model.is_fisheye()))
    });
    for found in flag.into_iter().chain(models) {
        let (entry, Some(is)) = found? else { continue };
        match &said {
            Some((first, other)) if *other != is => {
                let reason = format_args!("contradicts {}; keep the one that is right", first.name());
                return Err(entry.error(reason));
            }
            _ => said = Some((entry, is)),
        }
    }
    Ok(said.is_some_and(|(_, is)| is))
}

fn fisheye_flag(entry: &Entry) -> Result<bool> {
    match entry.word()? {
        "1" | "true" => Ok(true),
        "0" | "false" => Ok(false),
        _ => Err(entry.wrong("0 or 1, whether the lenses are fisheyes")),
    }
}

/// The distortion that the coefficients in `entry` describe.
pub(super) fn distortion(entry: &Entry, expected: &str, fisheye: bool) -> Result<Distortion> {
    if fisheye {
        let four =
            entry.list(expected)?.try_into().map_err(|_| entry.wrong("the 4 coefficients of a fisheye"))?;
        return Ok(Distortion::Equidistant(four));
    }
    radial_tangential(entry, expected).map(Distortion::RadialTangential)
}

/// The polynomials of the coefficients in `entry`.
pub(super) fn radial_tangential(entry: &Entry, expected: &str) -> Result<RadialTangential> {
    RadialTangential::new(&entry.list(expected)?).map_err(|expected| entry.wrong(expected))
}

/// Focal length and principal point of a camera matrix.
pub(super) fn camera(entry: &Entry) -> Result<([f64; 2], [f64; 2])> {
    match entry.matrix::<3, 3>()? {
        [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]] if fx > 0.0 && fy > 0.0 => Ok(([fx, fy], [cx, cy])),
        _ => Err(entry.wrong("a camera matrix like [f 0 cx; 0 f cy; 0 0 1] with f above 0 and no skew")),
    }
}

/// The rotation from the left camera to another one, which errors call `other`.
pub(super) fn rotation_of(entries: &Entries, what: &str) -> Result<Matrix> {
    let expected = format!("{what}, 3 x 3 or a rotation vector");
    let entry = entries.require(ROTATION, "R", &format!("{expected}, here or in a further file"))?;
    match entry.numbers::<3>(&expected) {
        Ok(vector) => Ok(rotation(vector)),
        Err(_) => entry.rotation(&entry.matrix()?),
    }
}

/// The pose of the right camera relative to the left one.
pub(super) fn pose(entries: &Entries) -> Result<Pose> {
    let rotation = rotation_of(entries, "the rotation from the left camera to the right one")?;
    let expected = "3 numbers, the left camera in the frame of the right one";
    let entry = entries.require(TRANSLATION, "T", expected)?;
    let translation: [f64; 3] = entry.numbers(expected)?;
    if length(translation) == 0.0 {
        return Err(entry.wrong("the two cameras apart"));
    }
    Ok(Pose { rotation, translation })
}

fn views(entries: &Entries) -> Result<RectifiedViews> {
    let mut rotations = [IDENTITY; 2];
    let mut projections = Vec::new();
    for (view, rotation) in rotations.iter_mut().enumerate() {
        // Rectified images have no rotation.
        if let Some(entry) = entries.find(RECTIFICATION[view]) {
            *rotation = entry.rotation(&entry.matrix()?)?;
        }
        let called = ["P1", "P2"][view];
        let expected = "the projection of the rectified camera, a matrix of 3 x 4";
        projections.push(projection(&entries.require(PROJECTION[view], called, expected)?)?);
    }
    let entry = entries.require(PROJECTION[1], "P2", "")?;
    let size = entries.find(NEW_SIZE).map(|entry| entry.size()).transpose()?;
    Ok(RectifiedViews { size, ..rectified(&entry, rotations, [projections[0], projections[1]])? })
}

/// A rectified camera.
#[derive(Clone, Copy)]
pub(super) struct Projection {
    pub(super) camera: Camera,
    /// The origin (x, y) in the camera's frame: the fourth column of its matrix divided by the focal length.
    pub(super) offset: [f64; 2],
}

pub(super) fn projection(entry: &Entry) -> Result<Projection> {
    match entry.matrix::<3, 4>()? {
        [[fx, 0.0, cx, tx], [0.0, fy, cy, ty], [0.0, 0.0, 1.0, 0.0]] if fx > 0.0 && fy > 0.0 => {
            let camera = Camera { focal_length: [fx, fy], principal_point: [cx, cy] };
            Ok(Projection { camera, offset: [tx / fx, ty / fy] })
        }
        _ => Err(entry.wrong("a projection like [f 0 cx tx; 0 f cy ty; 0 0 1 0] with f above 0")),
    }
}

/// The rectification by two projections; `entry` is the second one, for errors.
pub(super) fn rectified(
    entry: &Entry,
    rotations: [Matrix; 2],
    [left, right]: [Projection; 2],
) -> Result<RectifiedViews> {
    let [a, b] = [left.camera, right.camera];
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-3 * (1.0 + a.abs());
    let translation: [f64; 2] = std::array::from_fn(|i| right.offset[i] - left.offset[i]);
    // The direction in which both views must agree.
    let across = usize::from(translation[0].abs() >= translation[1].abs());
    let agree = (0..2).all(|i| close(a.focal_length[i], b.focal_length[i]))
        && close(a.principal_point[across], b.principal_point[across]);
    if !agree {
        return Err(entry.wrong("the focal length and the rows of the left projection"));
    }
    if translation.iter().all(|v| *v == 0.0) {
        return Err(entry.wrong("focal length times baseline in its fourth column"));
    }
    Ok(RectifiedViews { rotations, cameras: [a, b], translation, size: None })
}
