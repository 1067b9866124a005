//! The functions of the fuzz targets; the input is the content of a file. `cli/tests/corpus.rs` replays the corpus through them.
//!
//! A file is either read, with all invariants, or refused with one line that fits a screen.

use mrfgs::calibration::{self, pose};
use mrfgs::image::calib::Calibration;
use mrfgs::image::pfm::{self, Pfm};
use mrfgs::image::read::Reader;
use mrfgs::image::read_cloud;
use mrfgs::options::{DisparityRange, Method, PRESETS};
use mrfgs::rectification::{Options, Rectification};
use mrfgs::{Error, Result};
use mrfgs_cli::list::{self, Largest};
use mrfgs_ros::messages::{CameraInfo, CompressedImage, Image};
use mrfgs_ros::pixels;
use mrfgs_ros::recording::{Message, Recording};
use std::collections::HashSet;
use std::io::Write;
use std::path::Path;

/// Maximum number of pixels of an image, small to keep inputs fast.
pub const MAX_PIXELS: u64 = 1 << 16;

/// A PFM file.
pub fn pfm(bytes: &[u8]) {
    with_file(bytes, |path| {
        let map = Reader { max_pixels: MAX_PIXELS, ..Reader::default() }.disparity(path);
        match told(pfm::read(path)) {
            Some(Pfm::Grey(plane)) if (plane.data().len() as u64) <= MAX_PIXELS => {
                let map = map.expect("a plane is a map of disparities");
                assert_eq!(map.size(), plane.size());
                for (disparity, value) in map.data().iter().zip(plane.data()) {
                    assert!(
                        disparity.to_bits() == value.to_bits()
                            || !value.is_finite() && *disparity == f32::INFINITY
                    );
                }
            }
            _ => assert!(told(map).is_none()),
        }
    });
}

/// A calib.txt.
pub fn calib(bytes: &[u8]) {
    with_file(bytes, |path| {
        let Some(c) = told(Calibration::read(path)) else { return };
        assert!([c.ndisp, c.width, c.height].iter().flatten().all(|&count| count > 0));
        assert!([c.doffs, c.baseline, c.vmin, c.vmax].iter().flatten().all(|value| value.is_finite()));
        assert!(c.camera.is_none_or(|camera| {
            camera.focal_length.iter().all(|f| f.is_finite() && *f > 0.0)
                && camera.principal_point.iter().all(|c| c.is_finite())
        }));
    });
}

/// A recording: all topics and messages, decoded as images and cameras.
pub fn recording(bytes: &[u8]) {
    with_file(bytes, |path| {
        if !Recording::is(path) {
            return;
        }
        let Some(recording) = told(Recording::open(path)) else { return };
        let names: Vec<&str> = recording.topics().iter().map(|topic| topic.name.as_str()).collect();
        let mut failed = false;
        for message in recording.messages(&names) {
            assert!(!failed, "nothing follows an error");
            let Some(Message { topic, encoding, data }) = told(message) else {
                failed = true;
                continue;
            };
            assert!(topic < names.len());
            let named = |reason| Error::read(path, reason);
            if let Some(image) = told(Image::decode(&data, encoding).map_err(named)) {
                told(pixels::image(&image, MAX_PIXELS).map_err(named));
            }
            if let Some(image) = told(CompressedImage::decode(&data, encoding).map_err(named)) {
                told(pixels::compressed(
                    &image,
                    Reader { max_pixels: MAX_PIXELS, ..Reader::default() },
                    path,
                ));
            }
            if let Some(camera) = told(CameraInfo::decode(&data, encoding).map_err(named)) {
                let texts = [(path, camera.text()), (path, camera.of_rectified().text())];
                told(calibration::of_texts(&texts));
            }
        }
    });
}

/// A calibration of two cameras: read alone, and as both of two files.
pub fn cameras(bytes: &[u8]) {
    let (name, text) = (Path::new("cameras"), String::from_utf8_lossy(bytes).into_owned());
    let one = [(name, text)];
    for files in [&one[..], &[one[0].clone(), one[0].clone()]] {
        let Some(cameras) = told(calibration::of_texts(files)) else { continue };
        told(cameras.of_rectified_images(cameras.size));
        let size = cameras.size.unwrap_or((32, 24));
        for alpha in [None, Some(0.0), Some(1.0)] {
            let options = Options { alpha, ..Options::default() };
            let Some(by) = told(Rectification::new(&cameras, size, &options)) else { continue };
            let known = by.calibration().expect("a rectification has one");
            assert!(known.baseline.is_some_and(|baseline| baseline > 0.0));
            for place in [by.left(3.0, 4.0), by.right(31.0, 0.0)].into_iter().flatten() {
                assert!(place.iter().all(|v| v.is_finite()));
            }
        }
    }
}

/// An image of any kind: as both views and mask of a pair, as grey levels, and as a disparity map.
pub fn image(bytes: &[u8]) {
    with_file(bytes, |path| {
        let reader = Reader { max_pixels: MAX_PIXELS, ..Reader::default() };
        let pair = told(reader.pair(path, path, None));
        let levels = told(reader.grey8(path));
        let map = told(reader.disparity(path));
        let Some(pair) = pair else {
            assert!(levels.is_none() && map.is_none());
            return;
        };
        let (width, height) = pair.size();
        assert!((1..=MAX_PIXELS).contains(&(width as u64 * height as u64)));
        assert_eq!(pair.left(), pair.right());
        let mut pixels = pair.left().pixels.data().iter().zip(pair.left().masked.data());
        assert!(pixels.all(|(pixel, masked)| !masked || *pixel == [0; 4]));
        assert!(levels.is_none_or(|levels| levels.size() == pair.size()));
        assert!(map.is_none_or(|map| map.size() == pair.size()));
        let masked = told(reader.pair(path, path, Some(path))).expect("the same files");
        let mask = told(reader.mask(path)).expect("the same file");
        let mut masks = masked.left().masked.data().iter().zip(pair.left().masked.data()).zip(mask.data());
        assert!(masks.all(|((both, own), mask)| *both == (*own || *mask)));
    });
}

/// A list of pairs.
pub fn list(bytes: &[u8]) {
    with_file(bytes, |path| {
        let Some(rows) = told(list::read(path)) else { return };
        let mut names = HashSet::new();
        for row in rows {
            assert!(names.insert(row.name.to_lowercase()), "{} is there twice", row.name);
            assert!(!row.name.is_empty() && !row.left.is_empty() && row.right.as_deref() != Some(""));
            assert!(!row.name.contains(['/', '\\']) && !row.name.starts_with('.'), "{}", row.name);
            if let Some(Largest::Pixels(max)) = row.max_disparity {
                assert!(DisparityRange::new(row.min_disparity.unwrap_or(0), max).is_ok());
            }
        }
    });
}

/// A method in TOML, and the value of a key on the command line.
pub fn config(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    for preset in PRESETS {
        let before = preset.method();
        let kept = |method: &Method, changed: Option<()>| match changed {
            Some(()) => {
                let table = method.table().to_string();
                assert_eq!(with_file(table.as_bytes(), |path| Method::default().load(path)).ok(), Some(()));
                assert!(method.clone().validated().is_ok());
            }
            None => assert_eq!(*method, before),
        };
        let mut method = before.clone();
        let changed = told(with_file(bytes, |path| method.load(path)));
        kept(&method, changed);
        if let Some((key, value)) = text.split_once('=') {
            let mut method = before.clone();
            let changed = told(method.set(key.trim(), value.trim()));
            kept(&method, changed);
        }
    }
}

/// A point cloud in any form: what has no mark of its own is a scan of KITTI or a text, by its name.
pub fn scan(bytes: &[u8]) {
    for name in ["scan.bin", "scan.xyz"] {
        let Some(points) = told(read_cloud::positions_in_memory(Path::new(name), bytes.to_vec())) else {
            continue;
        };
        assert!(!points.is_empty());
        assert!(points.as_flattened().iter().all(|v| v.is_finite()));
    }
}

/// The pose of a point cloud.
pub fn pose(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let Some(pose) = told(pose::of_text(Path::new("pose"), &text)) else { return };
    assert!(pose.translation.iter().all(|v| v.is_finite()));
    let rows = pose.rotation;
    for i in 0..3 {
        for j in 0..3 {
            let product: f64 = (0..3).map(|k| rows[i][k] * rows[j][k]).sum();
            assert!((product - f64::from(u8::from(i == j))).abs() < 1e-6, "{rows:?}");
        }
    }
}

/// Runs `f` with a file that contains `bytes`.
fn with_file<T>(bytes: &[u8], f: impl FnOnce(&Path) -> T) -> T {
    let memory = Path::new("/dev/shm");
    let folder = if memory.is_dir() { memory.into() } else { std::env::temp_dir() };
    let mut file = tempfile::NamedTempFile::new_in(folder).expect("a file can be made");
    file.write_all(bytes).expect("it can be written");
    f(file.path())
}

/// The value, or `None` for an error, which must be one printable line.
pub fn told<T>(result: Result<T>) -> Option<T> {
    let refused = |error: Error| {
        let text = error.to_string();
        assert!(text.chars().count() <= 500 && !text.chars().any(char::is_control), "{text:?}");
    };
    result.map_err(refused).ok()
}
