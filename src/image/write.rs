//! Writes maps and pictures: a file is written completely or not at all.

use std::fs;
use std::path::Path;

use image::ExtendedColorType;

use super::picture::{Picture, png, png_or_tiff_size};
use super::save::check;
use super::{Georeference, Plane, pfm, tiff};
use crate::error::{Error, Reason, Result};

#[cfg(not(target_arch = "wasm32"))]
pub use super::bands::{Bands, Level, picture_in_bands};
pub use super::save::{Growing, no_folder, publish, remove, save};
#[cfg(feature = "cameras")]
pub use super::save_cloud::cloud;

/// Disparities in 16-bit PNG files are in 1/256 of a pixel, as in the KITTI benchmark.
const PNG_SCALE: f32 = 256.0;

/// The format of a disparity map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Pfm,
    Png,
    Tiff,
}

/// Settings for writing maps. [`Plane::save`] uses the default.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Writer {
    /// The georeference of the map: that of [`Pair::georeferences`](super::Pair::georeferences). Only TIFF
    /// can hold it.
    pub georeference: Option<Georeference>,
}

impl Writer {
    /// Writes a disparity map (in pixels; not finite = invalid) in the format of the extension:
    ///
    /// - `.pfm`: float; invalid is +infinity;
    /// - `.tif`, `.tiff`: float; invalid is NaN, which GDAL's no-data tag declares. More than 4 Mi pixels are in tiles, packed by
    ///   Deflate with the predictor of floats. A file of more than 4 GiB is BigTIFF;
    /// - `.png`: 16 bits, disparity times 256; invalid is 0, as in the KITTI benchmark. Only disparities from 0
    ///   to below 256; a valid one that would round to 0 becomes 1.
    ///
    /// An existing path that is not a regular file (`/dev/null`, a pipe) is written to directly, as PFM if
    /// its name has no known extension.
    ///
    /// # Errors
    /// [`Error::Write`] for an unknown extension, a disparity that PNG cannot hold, or a file that cannot be
    /// written.
    pub fn disparity(&self, path: &Path, map: &Plane<f32>) -> Result<()> {
        save(path, &self.encode_disparity(path, map)?)
    }

    /// The bytes of the file that [`Writer::disparity`] would write to `path`.
    ///
    /// # Errors
    /// [`Error::Write`] for an unknown extension, and a disparity that PNG cannot hold.
    pub fn encode_disparity(&self, path: &Path, map: &Plane<f32>) -> Result<Vec<u8>> {
        match format(path)? {
            Format::Pfm => Ok(pfm::encode(&map.map(|&d| if d.is_finite() { d } else { f32::INFINITY }))),
            Format::Png => {
                let levels = png_levels(map).map_err(|reason| Error::write(path, reason))?;
                png(path, bytemuck::cast_slice(&levels), map.size(), ExtendedColorType::L16)
            }
            Format::Tiff => {
                let size = png_or_tiff_size(path, map.size())?;
                let map = map.map(|&d| if d.is_finite() { d } else { f32::NAN });
                tiff::encode(&map, size, self.georeference.as_ref())
                    .map_err(|e| Error::write(path, e.to_string()))
            }
        }
    }

    /// Writes a depth map (not finite = invalid) like [`Writer::disparity`], except as PNG, which has no
    /// unit.
    ///
    /// # Errors
    /// [`Error::Write`] for an extension other than `.pfm`, `.tif` and `.tiff`, or a file that cannot be written.
    pub fn depth(&self, path: &Path, map: &Plane<f32>) -> Result<()> {
        check_float(path)?;
        self.disparity(path, map)
    }
}

impl Plane<f32> {
    /// Writes this disparity map, like [`Writer::disparity`] with the default settings.
    ///
    /// # Errors
    /// The errors of [`Writer::disparity`].
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        Writer::default().disparity(path.as_ref(), self)
    }
}

/// Checks before any computation that [`Writer::disparity`] will be able to write a map with disparities from
/// `min_disparity` to `max_disparity` (pixels, both inclusive) to `path`. An existing file stays untouched.
///
/// # Errors
/// [`Error::Write`] when the extension is unknown, the path is a folder or its folder is not writable, or the
/// format cannot hold the range.
pub fn check_disparity_path(path: &Path, min_disparity: i32, max_disparity: i32) -> Result<()> {
    if format(path)? == Format::Png && (min_disparity < 0 || max_disparity > 255) {
        let reason = format!(
            "16-bit PNG holds disparities from 0 to 255, but the range is {min_disparity} to {max_disparity}; \
             write .pfm or .tif"
        );
        return Err(Error::write(path, Reason::of_request(reason)));
    }
    check(path)
}

/// Checks before any computation that [`Writer::depth`] will be able to write a map to `path`.
///
/// # Errors
/// [`Error::Write`] when the extension is none of `.pfm`, `.tif` and `.tiff`, the path is a folder, or its
/// folder is not writable.
pub fn check_depth_path(path: &Path) -> Result<()> {
    check_float(path)?;
    check(path)
}

/// Checks before any computation that a PNG picture can be written to `path`.
///
/// # Errors
/// [`Error::Write`] when the extension is not `.png`, the path is a folder, or its folder is not writable.
pub fn check_png_path(path: &Path) -> Result<()> {
    png_extension(path)?;
    check(path)
}

/// Checks before any computation that a file can be written to `path`, with any extension.
///
/// # Errors
/// [`Error::Write`] when the path is a folder, or its folder is not writable.
pub fn check_path(path: &Path) -> Result<()> {
    check(path)
}

/// Writes a picture as PNG.
///
/// # Errors
/// [`Error::Write`] when the extension is not `.png` or the file cannot be written.
pub fn picture(path: &Path, picture: &impl Picture) -> Result<()> {
    png_extension(path)?;
    save(path, &picture.png(path)?)
}

fn check_float(path: &Path) -> Result<()> {
    match format(path) {
        Ok(Format::Pfm | Format::Tiff) => Ok(()),
        _ => Err(Error::write(path, Reason::of_request("depth maps end in .pfm or .tif (float)"))),
    }
}

fn png_extension(path: &Path) -> Result<()> {
    if extension(path).as_deref() == Some("png") || is_special(path) {
        return Ok(());
    }
    Err(Error::write(path, Reason::of_request("pictures are written as PNG; give a name that ends in .png")))
}

pub(super) fn format(path: &Path) -> Result<Format> {
    match extension(path).as_deref() {
        Some("pfm") => Ok(Format::Pfm),
        Some("png") => Ok(Format::Png),
        Some("tif" | "tiff") => Ok(Format::Tiff),
        _ if is_special(path) => Ok(Format::Pfm),
        _ => Err(Error::write(
            path,
            Reason::of_request("disparity maps end in .pfm (float), .tif (float) or .png (16-bit)"),
        )),
    }
}

/// The extension in lower case.
pub(super) fn extension(path: &Path) -> Option<String> {
    Some(path.extension()?.to_str()?.to_ascii_lowercase())
}

/// Whether `path` exists and is neither a file nor a folder.
pub(super) fn is_special(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir())
}

/// Disparities in KITTI's format.
pub(super) fn png_levels(map: &Plane<f32>) -> std::result::Result<Vec<u16>, String> {
    let level = |&d: &f32| {
        let level = (d * PNG_SCALE).round();
        if !d.is_finite() {
            Ok(0)
        } else if d < 0.0 || level > u16::MAX as f32 {
            Err(format!(
                "16-bit PNG holds disparities from 0 to below 256, but one is {d}; write .pfm or .tif"
            ))
        } else {
            Ok((level as u16).max(1))
        }
    };
    map.data().iter().map(level).collect()
}

#[cfg(test)]
mod tests {
    use super::super::read::read_disparity;
    use super::*;
    use ::tiff::tags::Tag;
    use std::io::Cursor;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn maps_survive_a_round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let map = Plane::new(3, 2, vec![0.5, 255.0, f32::INFINITY, 17.25, 1.0 / 256.0, 3.0]);
        // Values that PNG cannot hold.
        let wild = Plane::new(2, 2, vec![-3.5, 256.0, 1e6, f32::INFINITY]);
        for (name, map) in [
            ("a.pfm", &map),
            ("a.PFM", &map),
            ("a.png", &map),
            ("a.tif", &map),
            ("a.Tiff", &map),
            ("b.pfm", &wild),
            ("b.tif", &wild),
        ] {
            let path = folder.path().join(name);
            map.save(&path).unwrap();
            assert_eq!(read_disparity(&path).unwrap(), *map, "{name}");
        }
        for bad in [-0.01, 255.999, 256.0, 1e30] {
            let error = Plane::filled(2, 1, bad).save(folder.path().join("b.png")).unwrap_err();
            let error = error.to_string();
            assert!([".pfm", ".tif", "b.png"].iter().all(|word| error.contains(word)), "{error}");
        }
        assert_eq!(names(folder.path()).len(), 7, "nothing temporary stays");
    }

    #[test]
    fn invalid_pixels_have_the_marker_of_each_format() {
        let map = Plane::new(4, 1, vec![f32::INFINITY, f32::NAN, f32::NEG_INFINITY, 1.0]);
        assert_eq!(png_levels(&map).unwrap(), [0, 0, 0, 256]);
        // A disparity of 0 is valid.
        assert_eq!(png_levels(&Plane::new(4, 1, vec![0.0, -0.0, 0.001, 255.99])).unwrap(), [1, 1, 1, 65533]);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pfm");
        map.save(&path).unwrap();
        let expected = Plane::new(4, 1, [[f32::INFINITY; 3].as_slice(), &[1.0]].concat());
        assert_eq!(pfm::read(&path).unwrap(), pfm::Pfm::Grey(expected));
        let path = folder.path().join("a.tif");
        map.save(&path).unwrap();
        let bytes = fs::read(&path).unwrap();
        let mut decoder = ::tiff::decoder::Decoder::new(Cursor::new(bytes)).unwrap();
        assert_eq!(decoder.get_tag_ascii_string(Tag::GdalNodata).unwrap(), "nan");
        let ::tiff::decoder::DecodingResult::F32(values) = decoder.read_image().unwrap() else {
            panic!("float")
        };
        assert_eq!(values.iter().map(|v| v.is_nan()).collect::<Vec<_>>(), [true, true, true, false]);
    }

    #[test]
    fn pictures_survive_a_round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        picture(&path, &Plane::new(2, 1, vec![3_u8, 200])).unwrap();
        assert_eq!(
            image::open(&path).unwrap(),
            image::DynamicImage::ImageLuma8(image::GrayImage::from_raw(2, 1, vec![3, 200]).unwrap())
        );
        picture(&path, &Plane::new(1, 1, vec![[1, 2, 3]])).unwrap();
        assert_eq!(image::open(&path).unwrap().into_rgb8().into_raw(), [1, 2, 3]);
        assert!(picture(&path, &Plane::<u8>::new(0, 0, vec![])).is_err());
        assert!(picture(&folder.path().join("a.jpg"), &Plane::new(1, 1, vec![0_u8])).is_err());
    }

    #[test]
    fn the_early_check_finds_later_failures() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let check = |name: &str, min, max| check_disparity_path(&at(name), min, max);
        check("a.pfm", -9, 999).unwrap();
        check("a.tif", -9, 999).unwrap();
        check("a.png", 0, 255).unwrap();
        check_png_path(&at("a.PNG")).unwrap();
        check_path(&at("a.json")).unwrap();
        assert!(names(folder.path()).is_empty(), "the check leaves nothing");
        fs::write(at("c.pfm"), "precious").unwrap();
        check("c.pfm", 0, 9).unwrap();
        assert_eq!(fs::read(at("c.pfm")).unwrap(), b"precious", "the check keeps what is there");

        fs::create_dir(at("b.pfm")).unwrap();
        let refused = |result: Result<()>, words: &[&str]| {
            let error = result.unwrap_err().to_string();
            assert!(words.iter().all(|w| error.contains(w)), "{error}");
            assert!(!error.contains('\n'), "{error}");
        };
        refused(check("a.png", -1, 10), &["a.png", ".pfm", ".tif", "-1"]);
        refused(check("a.png", 0, 256), &["a.png", ".pfm", ".tif", "256"]);
        refused(check("a.jpg", 0, 10), &[".pfm", ".tif", ".png"]);
        refused(check("a", 0, 10), &[".pfm"]);
        refused(check("b.pfm", 0, 10), &["b.pfm", "folder"]);
        refused(check("none/a.pfm", 0, 10), &["none", "create it"]);
        refused(check("a.pfm/", 0, 10), &["no file"]);
        refused(check_png_path(&at("a.jpg")), &["a.jpg", ".png"]);
        refused(check_png_path(&at("none/a.png")), &["create it"]);
        refused(check_path(&at("none/a.json")), &["create it"]);
        refused(check_path(&at("b.pfm")), &["b.pfm", "folder"]);
        refused(Plane::filled(1, 1, 0.0).save(at("none/a.pfm")), &["create it"]);
        refused(Plane::filled(1, 1, 0.0).save(at("b.pfm")), &["folder"]);
    }

    #[cfg(unix)]
    #[test]
    fn outputs_have_the_usual_permissions_and_links_stay() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("plain"), "").unwrap();
        Plane::filled(1, 1, 0.0).save(at("a.pfm")).unwrap();
        let mode = |name: &str| fs::metadata(at(name)).unwrap().permissions().mode();
        assert_eq!(mode("a.pfm"), mode("plain"));

        std::os::unix::fs::symlink(at("a.pfm"), at("link.pfm")).unwrap();
        Plane::filled(1, 1, 2.0).save(at("link.pfm")).unwrap();
        assert!(fs::symlink_metadata(at("link.pfm")).unwrap().is_symlink());
        assert_eq!(read_disparity(&at("a.pfm")).unwrap(), Plane::filled(1, 1, 2.0));

        fs::set_permissions(at("plain"), fs::Permissions::from_mode(0o444)).unwrap();
        fs::rename(at("plain"), at("plain.pfm")).unwrap();
        let error = check_disparity_path(&at("plain.pfm"), 0, 9).unwrap_err().to_string();
        assert!(error.contains("read-only"), "{error}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn devices_are_written_to_and_stay() {
        let null = Path::new("/dev/null");
        check_disparity_path(null, -9, 999).unwrap();
        check_png_path(null).unwrap();
        Plane::filled(1, 1, 0.0).save(null).unwrap();
        picture(null, &Plane::filled(1, 1, [0_u8; 3])).unwrap();
        assert!(is_special(null));
        // A disk that is always full.
        let error = Plane::filled(1, 1, 0.0).save("/dev/full").unwrap_err();
        assert!(matches!(error, Error::Write { .. }), "{error}");
    }
}
