//! `calib.txt`, the calibration file of the Middlebury benchmark.

use std::path::Path;
use std::str::FromStr;

use super::Rect;
use crate::error::{Error, Result};
use crate::text::{self, quoted};

pub use super::fit::Fit;

/// The limit for a file; calibration files have a dozen lines.
const MAX_BYTES: u64 = 1 << 20;

/// The contents of `calib.txt`. Every entry is optional, because the benchmarks leave out different ones.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Calibration {
    /// Bound on the number of disparity levels: disparities are in `0 .. ndisp`, in pixels.
    pub ndisp: Option<u32>,
    /// The left camera (`cam0`).
    pub camera: Option<Camera>,
    /// Horizontal offset of the principal points, `cx1 - cx0`, in pixels.
    pub doffs: Option<f64>,
    /// Distance of the cameras, in the unit of the file (Middlebury: millimetres).
    pub baseline: Option<f64>,
    /// Width of the images in pixels.
    pub width: Option<u32>,
    /// Height of the images in pixels.
    pub height: Option<u32>,
    /// Tight lower bound of the disparities, in pixels.
    pub vmin: Option<f64>,
    /// Tight upper bound of the disparities, in pixels.
    pub vmax: Option<f64>,
    /// The unit of the baseline, which Middlebury's files do not state: millimetres unless the file has `unit`.
    pub unit: Unit,
    /// The scaling or cropping by which it was adapted to other images than the file's.
    pub fit: Option<Fit>,
    /// Whether the file has the right camera to the left of the left one, so that they were exchanged.
    pub exchanged: bool,
}

/// The unit of a baseline, and thereby of depths and points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unit {
    /// The unit of Middlebury.
    #[default]
    Millimetre,
    /// Hundredths of a metre.
    Centimetre,
    /// The unit of ROS and Kalibr.
    Metre,
    /// The calibration does not state a unit, as in OpenCV, where it is that of the chessboard.
    Unknown,
}

impl Unit {
    const ALL: [(&'static str, Self); 4] =
        [("mm", Self::Millimetre), ("cm", Self::Centimetre), ("m", Self::Metre), ("unknown", Self::Unknown)];

    /// The symbol: mm, cm or m, or `unknown`.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, unit)| *unit == self).map_or("", |(name, _)| name)
    }

    /// The number of millimetres, if known.
    #[must_use]
    pub fn millimetres(self) -> Option<f64> {
        match self {
            Self::Millimetre => Some(1.0),
            Self::Centimetre => Some(10.0),
            Self::Metre => Some(1000.0),
            Self::Unknown => None,
        }
    }
}

impl FromStr for Unit {
    type Err = &'static str;

    fn from_str(text: &str) -> std::result::Result<Self, &'static str> {
        let known = Self::ALL.iter().find(|(name, _)| *name == text);
        known.map(|(_, unit)| *unit).ok_or("mm, cm, m or unknown")
    }
}

/// The matrix `[fx 0 cx; 0 fy cy; 0 0 1]` of a rectified camera, in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Horizontal and vertical focal length (fx, fy), above 0; usually equal in rectified images.
    pub focal_length: [f64; 2],
    /// Principal point (cx, cy): where the optical axis meets the image, relative to the centre of the top
    /// left pixel.
    pub principal_point: [f64; 2],
}

impl Camera {
    /// A camera of square pixels with its principal point in the middle of its images: with this focal
    /// length, in pixels, and images of (width, height).
    #[must_use]
    pub fn centred(focal_length: f64, (width, height): (usize, usize)) -> Self {
        let principal_point = [width, height].map(|count| (count as f64 - 1.0) / 2.0);
        Self { focal_length: [focal_length; 2], principal_point }
    }

    /// The camera for scaled or cropped images.
    pub(crate) fn in_size(&self, fit: &Fit) -> Self {
        let scale = fit.scale();
        Self {
            focal_length: [0, 1].map(|i| self.focal_length[i] * scale[i]),
            principal_point: fit.place(self.principal_point),
        }
    }
}

impl Calibration {
    /// A rectified pair of equal cameras at a distance of `baseline`, in `unit`.
    #[must_use]
    pub fn of_cameras(camera: Camera, baseline: f64, unit: Unit) -> Self {
        Self { camera: Some(camera), doffs: Some(0.0), baseline: Some(baseline), unit, ..Self::default() }
    }

    /// The calibration for images of this (width, height) if they are scaled; otherwise an unchanged copy.
    #[must_use]
    pub fn of_size(&self, size: (usize, usize)) -> Self {
        let known = self.width.zip(self.height).map(|(width, height)| (width as usize, height as usize));
        let Some(fit) = known.filter(|known| *known != size).and_then(|known| Fit::scaled(known, size))
        else {
            return self.clone();
        };
        let [across, _] = fit.scale();
        let side = |side: usize| u32::try_from(side).ok();
        Self {
            ndisp: self.ndisp.map(|ndisp| (f64::from(ndisp) * across).ceil() as u32),
            camera: self.camera.map(|camera| camera.in_size(&fit)),
            doffs: self.doffs.map(|doffs| doffs * across),
            width: side(size.0),
            height: side(size.1),
            vmin: self.vmin.map(|vmin| vmin * across),
            vmax: self.vmax.map(|vmax| vmax * across),
            fit: Some(fit),
            ..self.clone()
        }
    }

    /// The calibration of a part of the images, unscaled.
    pub(crate) fn of_part(&self, part: &Rect) -> Self {
        let side = |side: usize| u32::try_from(side).ok();
        Self {
            camera: self.camera.map(|camera| camera.in_size(&Fit::part(part))),
            width: side(part.x.len()),
            height: side(part.y.len()),
            ..self.clone()
        }
    }

    /// Reads `calib.txt` from the folder of `image`; `None` when there is none.
    ///
    /// # Errors
    /// The errors of [`Calibration::read`].
    pub fn beside(image: &Path) -> Result<Option<Self>> {
        let path = image.with_file_name("calib.txt");
        if path.exists() { Self::read(&path).map(Some) } else { Ok(None) }
    }

    /// Reads a calibration file.
    ///
    /// # Errors
    /// [`Error::Read`] when the file cannot be read, or a value is wrong; then the error names the line and
    /// the key.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = text::read(path, MAX_BYTES, "calibration file")?;
        // Only the keys known here matter, and they are ASCII.
        Self::of_text(path, &String::from_utf8_lossy(&bytes))
    }

    /// Parses the text of a file, which errors call `name`.
    ///
    /// # Errors
    /// [`Error::Read`] when a value is wrong; the error names the line and the key.
    pub fn of_text(name: &Path, text: &str) -> Result<Self> {
        Self::parse(text).map_err(|reason| Error::read(name, reason))
    }

    /// Whether a text is meant to be such a file: its first line is an entry, and some line has a known key,
    /// even if misspelt.
    pub(crate) fn is_meant(text: &str) -> bool {
        let mut keys = lines(text).map(|(_, line)| line.split_once('=').map(|(key, _)| key.trim()));
        let Some(Some(first)) = keys.next() else { return false };
        let has_sections = lines(text).any(|(_, line)| line.starts_with('['));
        let known = |key: &str| KEYS.contains(&key) || near(key).is_some();
        let is_word = first.chars().all(|c| c.is_alphanumeric() || c == '_');
        is_word && !has_sections && (known(first) || keys.flatten().any(known))
    }

    /// Parses `key=value` lines; lines that begin with # are comments. The error names line and key.
    fn parse(text: &str) -> std::result::Result<Self, String> {
        let mut calibration = Self::default();
        let mut right = None;
        let mut there: Vec<&str> = Vec::new();
        for (line, entry) in lines(text) {
            let (key, value) =
                entry.split_once('=').map_or((entry, None), |(key, value)| (key.trim(), Some(value.trim())));
            let word = key.split([' ', '\t', ':', ',']).next().unwrap_or_default();
            let mut put = || {
                let value = match value {
                    Some(value) if KEYS.contains(&key) => value,
                    None if KEYS.contains(&word) => return Err("expected key=value".to_owned()),
                    _ => return Err(unknown(key)),
                };
                if there.contains(&key) {
                    return Err("is there twice; keep one".to_owned());
                }
                there.push(key);
                match key {
                    "ndisp" => calibration.ndisp = Some(count(value)?),
                    "width" => calibration.width = Some(count(value)?),
                    "height" => calibration.height = Some(count(value)?),
                    "doffs" => calibration.doffs = Some(number(value)?),
                    "baseline" => calibration.baseline = Some(number(value)?),
                    "vmin" => calibration.vmin = Some(number(value)?),
                    "vmax" => calibration.vmax = Some(number(value)?),
                    "cam0" => calibration.camera = Some(camera(value)?),
                    "cam1" => right = Some((line, camera(value)?)),
                    "unit" => {
                        let wrong = |expected| format!("expected {expected}, found {}", quoted(value));
                        calibration.unit = value.parse().map_err(wrong)?;
                    }
                    // Keys about errors and the ground truth.
                    _ => {}
                }
                Ok::<(), String>(())
            };
            let called = if KEYS.contains(&word) { word.to_owned() } else { quoted(key) };
            put().map_err(|reason| format!("line {line}: {called}: {reason}"))?;
        }
        if there.is_empty() {
            return Err("is no calib.txt: expected lines such as ndisp=64".into());
        }
        if let Some((line, right)) = right {
            calibration.check_right(right).map_err(|reason| format!("line {line}: cam1: {reason}"))?;
        }
        Ok(calibration)
    }

    /// Checks that the right camera is the left one moved by `doffs` along the rows, or says what differs.
    fn check_right(&self, right: Camera) -> std::result::Result<(), String> {
        // Tolerates the rounding of files.
        const ROUNDING: f64 = 0.05;
        let Some(left) = self.camera else { return Ok(()) };
        let [f0, f1] = [left, right].map(|camera| camera.focal_length);
        let [[cx0, cy0], [cx1, cy1]] = [left, right].map(|camera| camera.principal_point);
        let apart = f0.iter().zip(f1).map(|(a, b)| (b / a - 1.0).abs()).fold(0.0, f64::max);
        if apart > 1e-4 {
            return Err(format!(
                "its focal length contradicts that of cam0 by {:.2} %; a rectified pair has one, so correct it or rectify again",
                100.0 * apart
            ));
        }
        if (cy1 - cy0).abs() > ROUNDING {
            return Err(format!(
                "its row cy={cy1} contradicts cy={cy0} of cam0 by {:.2} px; a rectified pair has one, so correct it or rectify again",
                (cy1 - cy0).abs()
            ));
        }
        match self.doffs {
            Some(doffs) if (cx1 - cx0 - doffs).abs() > ROUNDING => Err(format!(
                "cx1 - cx0 = {:.3} contradicts doffs={doffs} by {:.2} px; correct the one that is wrong",
                cx1 - cx0,
                (cx1 - cx0 - doffs).abs()
            )),
            _ => Ok(()),
        }
    }

    /// The cameras of the rectified pair and their baseline, if all are known.
    pub(crate) fn cameras(&self) -> Option<([Camera; 2], f64)> {
        let (left, doffs, baseline) = (self.camera?, self.doffs?, self.baseline?);
        let [cx, cy] = left.principal_point;
        Some(([left, Camera { principal_point: [cx + doffs, cy], ..left }], baseline))
    }
}

/// The keys of Middlebury's and similar files, and our own `unit`.
const KEYS: [&str; 15] = [
    "cam0", "cam1", "doffs", "baseline", "width", "height", "ndisp", "vmin", "vmax", "unit", "isint",
    "dyavg", "dymax", "dmin", "dmax",
];

/// The lines that are not comments, each with its number.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.trim_start_matches('\u{feff}').lines().enumerate().map(|(i, line)| (i + 1, line.trim()));
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// The known key that is closest to a misspelt one.
fn near(key: &str) -> Option<&'static str> {
    let most = match key.len() {
        0..=3 => return None,
        4 => 1,
        _ => 2,
    };
    KEYS.into_iter().find(|known| text::letters_apart(key, known) <= most)
}

fn unknown(key: &str) -> String {
    match near(key) {
        Some(known) => format!("is no entry of a calib.txt; {known} may be meant"),
        None => "is no entry of a calib.txt; leave it out, or put # in front of it".into(),
    }
}

/// A finite number.
fn number(text: &str) -> std::result::Result<f64, String> {
    text.parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| format!("{} is no number", quoted(text)))
}

/// A whole number of at least 1.
fn count(text: &str) -> std::result::Result<u32, String> {
    text.parse().ok().filter(|&v| v > 0).ok_or_else(|| format!("{} is no whole number above 0", quoted(text)))
}

/// A camera matrix `[fx 0 cx; 0 fy cy; 0 0 1]`.
fn camera(text: &str) -> std::result::Result<Camera, String> {
    let wrong = || format!("{} is not a camera matrix like [f 0 cx; 0 f cy; 0 0 1]", quoted(text));
    let inner = text.strip_prefix('[').and_then(|t| t.strip_suffix(']')).ok_or_else(wrong)?;
    let mut entries = Vec::new();
    for row in inner.split(';') {
        let row: Vec<f64> = row
            .split([' ', '\t', ','])
            .filter(|w| !w.is_empty())
            .map(number)
            .collect::<std::result::Result<_, _>>()?;
        if row.len() != 3 {
            return Err(wrong());
        }
        entries.extend(row);
    }
    match entries[..] {
        [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0] if fx > 0.0 && fy > 0.0 => {
            Ok(Camera { focal_length: [fx, fy], principal_point: [cx, cy] })
        }
        _ => Err(wrong()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOTORCYCLE: &str = "cam0=[3979.911 0 1244.772; 0 3979.911 1019.507; 0 0 1]\n\
        cam1=[3979.911 0 1369.115; 0 3979.911 1019.507; 0 0 1]\ndoffs=124.343\nbaseline=193.001\n\
        width=2964\nheight=2000\nndisp=280\nisint=0\nvmin=31\nvmax=257\ndyavg=0.918\ndymax=1.516\n";

    fn expected() -> Calibration {
        Calibration {
            ndisp: Some(280),
            camera: Some(Camera { focal_length: [3979.911; 2], principal_point: [1244.772, 1019.507] }),
            doffs: Some(124.343),
            baseline: Some(193.001),
            width: Some(2964),
            height: Some(2000),
            vmin: Some(31.0),
            vmax: Some(257.0),
            ..Calibration::default()
        }
    }

    #[test]
    fn reads_the_benchmarks_file() {
        assert_eq!(Calibration::parse(MOTORCYCLE).unwrap(), expected());
        // Variants that other programs save.
        let edited = format!("\u{feff}{}", MOTORCYCLE.replace('\n', "\r\n\r\n").replace('=', " = "));
        assert_eq!(Calibration::parse(&edited).unwrap(), expected());
    }

    #[test]
    fn comments_and_keys_of_other_sets_are_skipped() {
        let text = "# of a rig \u{fffd}\n\nndisp=64\ndmin=-3\n  # width=5\nisint=0\n";
        assert_eq!(Calibration::parse(text).unwrap(), Calibration { ndisp: Some(64), ..Default::default() });
    }

    #[test]
    fn a_file_is_meant_as_a_calibration_by_its_keys() {
        for text in ["ndisp=64", "# of a rig\n\nndips=48", "name=a\nwidth = 3", "NDISP=3"] {
            assert!(Calibration::is_meant(text), "{text}");
        }
        for text in ["", "abc=1", "let width = 3;", "width: 3", "<a b=\"1\">", "a\nwidth=3", "[a]\nwidth=3"] {
            assert!(!Calibration::is_meant(text), "{text}");
        }
    }

    #[test]
    fn errors_name_line_and_key() {
        for (text, words) in [
            ("width=3\nndisp=many", ["line 2", "ndisp"]),
            ("ndisp=-3", ["line 1", "ndisp"]),
            ("ndisp=0", ["line 1", "ndisp"]),
            ("ndisp=99999999999", ["line 1", "ndisp"]),
            ("ndisp 64", ["line 1: ndisp", "expected key=value"]),
            ("width=3\nndips=64", ["line 2: `ndips`", "ndisp may be meant"]),
            ("Width=3", ["line 1: `Width`", "width may be meant"]),
            ("width=3\nfocal=4", ["line 2: `focal`: is no entry of a calib.txt", "put # in front of it"]),
            ("width=3\nsome words", ["line 2: `some words`", "is no entry of a calib.txt"]),
            ("P0: 7.2e2 0 6e2", ["line 1: `P0: 7.2e2 0 6e2`", "is no entry of a calib.txt"]),
            ("ndisp=64\nwidth=3\nndisp=64", ["line 3: ndisp", "is there twice; keep one"]),
            ("isint=0\nisint=0", ["line 2: isint", "is there twice; keep one"]),
            ("", ["is no calib.txt", "ndisp=64"]),
            ("# only a comment", ["is no calib.txt", "ndisp=64"]),
            ("\nheight=", ["line 2", "height"]),
            ("vmin=NaN", ["line 1", "vmin"]),
            ("doffs=inf", ["line 1", "doffs"]),
            ("cam0=[1 0 2; 0 1 2]", ["line 1", "cam0"]),
            ("cam0=[1 0 2; 0 1 2; 0 0 1", ["line 1", "cam0"]),
            ("cam0=[1 0 2; 0 1 x; 0 0 1]", ["line 1", "cam0"]),
            ("cam0=[1 0; 2 0 1 2; 0 0 1]", ["line 1", "cam0"]),
            ("cam0=[1 0 2; 0 0 2; 0 0 1]", ["line 1", "cam0"]),
            ("cam0=[1 9 2; 0 1 2; 0 0 1]", ["line 1", "cam0"]),
            ("cam1=[-1 0 2; 0 1 2; 0 0 1]", ["line 1", "cam1"]),
            ("baseline=1\nunit=feet", ["line 2", "mm, cm, m or unknown"]),
            (
                "cam0=[100 0 2; 0 100 2; 0 0 1]\ncam1=[101 0 2; 0 101 2; 0 0 1]",
                ["line 2: cam1", "contradicts that of cam0 by 1.00 %"],
            ),
            (
                "cam1=[100 0 2; 0 100 3; 0 0 1]\ncam0=[100 0 2; 0 100 2; 0 0 1]",
                ["line 1: cam1", "cy=3 contradicts cy=2 of cam0 by 1.00 px"],
            ),
            (
                "cam0=[9 0 2; 0 9 2; 0 0 1]\ncam1=[9 0 7.5; 0 9 2; 0 0 1]\ndoffs=-5.5",
                ["line 2: cam1", "cx1 - cx0 = 5.500 contradicts doffs=-5.5 by 11.00 px"],
            ),
        ] {
            let reason = Calibration::parse(text).unwrap_err();
            assert!(words.iter().all(|w| reason.contains(w)), "{text:?}: {reason}");
            assert!(!reason.contains('\n'), "{reason}");
        }
    }

    #[test]
    fn the_centre_of_an_image_is_between_its_pixels() {
        let camera = Camera::centred(700.0, (640, 481));
        assert_eq!(camera, Camera { focal_length: [700.0; 2], principal_point: [319.5, 240.0] });
        let calibration = Calibration::of_cameras(camera, 0.12, Unit::Metre);
        let text = "cam0=[700 0 319.5; 0 700 240; 0 0 1]\ndoffs=0\nbaseline=0.12\nunit=m\n";
        assert_eq!(calibration, Calibration::parse(text).unwrap());
    }

    #[test]
    fn images_can_have_another_size() {
        let half = expected().of_size((1482, 1000));
        let camera = Camera { focal_length: [1989.9555; 2], principal_point: [622.136, 509.5035] };
        assert_eq!(half.camera, Some(camera));
        assert_eq!((half.ndisp, half.doffs, half.baseline), (Some(140), Some(62.1715), Some(193.001)));
        assert_eq!((half.width, half.height, half.vmin), (Some(1482), Some(1000), Some(15.5)));
        assert_eq!(half.fit.map(|fit| fit.calibrated), Some((2964, 2000)));
        for size in [(2964, 2000), (2964, 1900)] {
            assert_eq!(expected().of_size(size), expected());
        }
    }

    #[test]
    fn a_calibration_is_found_beside_the_image() {
        let folder = tempfile::tempdir().unwrap();
        let image = folder.path().join("im0.png");
        assert_eq!(Calibration::beside(&image).unwrap(), None);
        std::fs::write(folder.path().join("calib.txt"), MOTORCYCLE).unwrap();
        assert_eq!(Calibration::beside(&image).unwrap(), Some(expected()));
        std::fs::write(folder.path().join("calib.txt"), "ndisp=x").unwrap();
        let error = Calibration::beside(&image).unwrap_err().to_string();
        assert!(error.contains("calib.txt") && error.contains("line 1"), "{error}");
    }
}
