//! The page that shows a map and its surface: one HTML file that needs no other file and no network.

use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use flate2::Compression;
use flate2::write::GzEncoder;
use mrfgs::Error;
use mrfgs::colour::{self, ColourMap};
use mrfgs::depth::Rig;
use mrfgs::image::calib::{Calibration, Camera, Unit};
use mrfgs::image::picture::Picture as _;
use mrfgs::image::{Image, Plane, write};
use mrfgs::maps::REASONS;
use serde::Serialize;

use crate::console;
use crate::failure::Result;

/// The page without its data.
const TEMPLATE: &str = include_str!("page.html");
/// Stands for the data in the template.
const PLACE: &str = "{{DATA}}";
/// About the most pixels of a page; browsers hold no more of them in a canvas. Of a larger map it shows every so many rows and columns.
const MOST: usize = 1 << 24;

/// A map in pixels of disparity, and what is known of it. All planes are of the left view.
pub(crate) struct Page<'a> {
    /// Not finite where there is no disparity.
    pub(crate) map: &'a Plane<f32>,
    pub(crate) confidence: Option<&'a Plane<u8>>,
    pub(crate) validity: Option<&'a Plane<u8>>,
    pub(crate) left: Option<&'a Image>,
    /// Without it, the page guesses the cameras and says so.
    pub(crate) rig: Option<Rig>,
    /// The depth beyond which the surface is left out, in the unit of the baseline.
    pub(crate) clip_depth: Option<f64>,
    pub(crate) colours: ColourMap,
}

/// The data of a page. Planes are packed by gzip, in base64 like the picture and the colours.
#[derive(Serialize)]
struct Data<'a> {
    name: &'a str,
    /// Columns and rows of the whole map.
    size: [usize; 2],
    /// Every so many columns and rows are in the planes.
    step: usize,
    /// Float32, little-endian.
    disparity: String,
    confidence: Option<String>,
    validity: Option<String>,
    /// A PNG file.
    left: Option<String>,
    cameras: Cameras,
    clip_depth: Option<f64>,
    /// 256 colours of 3 bytes, from far to near.
    colours: String,
    /// The bits of the validity, each with its name.
    reasons: [(u8, &'static str); REASONS.len()],
}

#[derive(Serialize)]
struct Cameras {
    /// Whether the numbers are a guess, so that depths have no scale.
    guessed: bool,
    /// In pixels, across and down.
    focal_length: [f64; 2],
    principal_point: [f64; 2],
    doffs: f64,
    baseline: f64,
    unit: &'static str,
}

impl Cameras {
    /// The cameras of `rig`; without it, the focal length is the width of the images, and the baseline 1.
    fn of(rig: Option<&Rig>, size: (usize, usize)) -> Self {
        let guess = Camera::centred(size.0 as f64, size);
        let Calibration { camera, doffs, baseline, unit, .. } =
            rig.map_or_else(|| Calibration::of_cameras(guess, 1.0, Unit::Unknown), Rig::calibration);
        let Camera { focal_length, principal_point } = camera.unwrap_or(guess);
        Self {
            guessed: rig.is_none(),
            focal_length,
            principal_point,
            doffs: doffs.unwrap_or(0.0),
            baseline: baseline.unwrap_or(1.0),
            unit: unit.name(),
        }
    }
}

impl Page<'_> {
    /// Writes the page of the map called `name` to `path`.
    pub(crate) fn save(&self, path: &Path, name: &str) -> Result<()> {
        let size @ (width, height) = self.map.size();
        let step = ((width * height).div_ceil(MOST) as f64).sqrt().ceil() as usize;
        let floats = |map: &Plane<f32>| {
            let of_pixel = |d: &f32| if d.is_finite() { *d } else { f32::INFINITY };
            packed(&map.data().iter().map(of_pixel).flat_map(f32::to_le_bytes).collect::<Vec<_>>())
        };
        let bytes = |plane: Option<&Plane<u8>>| plane.map(|plane| packed(thinned(plane, step).data()));
        let left = self.left.map(|left| thinned(&left.to_rgb8(), step).png(path)).transpose()?;
        let ramp = Plane::from_fn(256, 1, |x, _| x as f32);
        let data = Data {
            name,
            size: [width, height],
            step,
            disparity: floats(&thinned(self.map, step)),
            confidence: bytes(self.confidence),
            validity: bytes(self.validity),
            left: left.map(|png| BASE64.encode(png)),
            cameras: Cameras::of(self.rig.as_ref(), size),
            clip_depth: self.clip_depth,
            colours: BASE64.encode(colour::preview(&ramp, 0.0, 255.0, self.colours).row(0).concat()),
            reasons: REASONS.map(|(bit, name, _)| (bit, name)),
        };
        let data = serde_json::to_string(&data).map_err(|e| Error::write(path, e.to_string()))?;
        // A name may hold what begins a comment or a script.
        let data = data.replace('<', "\\u003c");
        Ok(write::save(path, TEMPLATE.replacen(PLACE, &data, 1).as_bytes())?)
    }
}

/// Writes the page of the map called `name` with `save`, into a new folder among the temporary files, which stays. Returns its path.
pub(crate) fn aside(name: &str, save: impl FnOnce(&Path) -> Result<()>) -> Result<PathBuf> {
    let parent = std::env::temp_dir();
    let made = tempfile::Builder::new().prefix("mrfgs-").tempdir_in(&parent);
    let folder = made.map_err(|e| Error::write(&parent, e))?;
    let path = folder.path().join(format!("{name}.view.html"));
    save(&path)?;
    let _ = folder.keep();
    Ok(path)
}

/// The name of the map that a page at `path` shows: `d` for `d.view.html`.
pub(crate) fn name(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or(OsStr::new("")).to_string_lossy();
    stem.strip_suffix(".view").unwrap_or(&stem).to_owned()
}

/// Shows a page in the browser of this system without waiting for it, and says where the page is. Without a browser, it says what to do,
/// even if `quiet`.
pub(crate) fn show(path: &Path, quiet: bool) {
    let place = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    match open::that_detached(&place) {
        Ok(()) if quiet => {}
        Ok(()) => console::say(&format!("opened {} in the browser", place.display())),
        Err(_) => console::say(&format!(
            "no browser starts here; open {} in one, also on another machine: it is a single file",
            place.display()
        )),
    }
}

/// Every `step`th column and row.
fn thinned<T: Copy>(plane: &Plane<T>, step: usize) -> Plane<T> {
    let (width, height) = plane.size();
    Plane::from_fn(width.div_ceil(step), height.div_ceil(step), |x, y| plane[(x * step, y * step)])
}

/// The bytes packed by gzip, in base64.
fn packed(bytes: &[u8]) -> String {
    let mut packer = GzEncoder::new(Vec::new(), Compression::default());
    let packed = packer.write_all(bytes).and_then(|()| packer.finish());
    BASE64.encode(packed.expect("memory takes all bytes"))
}
