//! COLMAP's `cameras.txt` and `images.txt` of two images, the left one first.

use super::cameras::{Pose, StereoCalibration};
use super::lens::{Distortion, Lens, RadialTangential};
use super::node::{Entries, Entry, Node};
use super::posed::{Posed, pair};
use crate::error::Result;
use crate::image::calib::Unit;

/// Camera models, each with the number of its parameters.
const MODELS: [(&str, usize); 11] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("FULL_OPENCV", 12),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("OPENCV_FISHEYE", 8),
    ("FOV", 5),
    ("THIN_PRISM_FISHEYE", 12),
];

// The names that `parse` gives to the two files.
const CAMERAS: &str = "cameras.txt";
const IMAGES: &str = "images.txt";

/// The lines of one of these files as entries; `None` for any other file.
pub(super) fn parse(text: &str) -> Option<Node> {
    let words =
        |line: &str| Node::List(line.split_whitespace().map(|word| Node::Scalar(word.into())).collect());
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let first: Vec<&str> = lines.clone().find(|line| !line.trim().is_empty())?.split_whitespace().collect();
    let numbers = |words: &[&str]| words.iter().all(|word| word.parse::<f64>().is_ok());
    let mut rows = Vec::new();
    let name = match first[..] {
        [id, model, ref rest @ ..]
            if numbers(&[id]) && numbers(rest) && MODELS.iter().any(|(name, _)| *name == model) =>
        {
            rows.extend(lines.filter(|line| !line.trim().is_empty()).map(words));
            CAMERAS
        }
        [ref placed @ .., _] if placed.len() == 9 && numbers(placed) => {
            // Every second line lists the points of the image, and may be empty.
            while let Some(line) = lines.next() {
                if !line.trim().is_empty() {
                    rows.push(words(line));
                    lines.next();
                }
            }
            IMAGES
        }
        _ => return None,
    };
    Some(Node::Map(vec![(name.into(), Node::List(rows))]))
}

/// Whether both files are COLMAP's, or either of them.
pub(super) fn is(entries: &Entries) -> bool {
    entries.find("cameras.txt images.txt").is_some()
}

pub(super) fn read(entries: &Entries) -> Result<StereoCalibration> {
    let cameras = entries.require(CAMERAS, CAMERAS, "COLMAP's cameras, in the other file")?;
    let entry = entries.require(IMAGES, IMAGES, "COLMAP's images, in the other file")?;
    let images = entry.items()?;
    let Ok([left, right]) = <[Entry; 2]>::try_from(images) else {
        return Err(entry.error("does not have two images; keep the two of the pair, the left one first"));
    };
    pair(&image(left, &cameras)?, &image(right, &cameras)?, Unit::Unknown)
}

/// The pose of the first image of `images.txt`, from the frame of the reconstruction; `None` for other files.
pub(super) fn first_image(entries: &Entries) -> Option<Result<Pose>> {
    let images = entries.find(IMAGES)?.items();
    let first = images.map(|images| images.into_iter().next());
    first.transpose().map(|first| first.and_then(|image| Ok(placed(&image)?.0)))
}

/// The pose in a line of `images.txt`, and the number of the camera.
fn placed(entry: &Entry) -> Result<(Pose, f64)> {
    let expected = "IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME";
    let words = entry.items()?;
    let [_, numbers @ .., _] = &words[..] else { return Err(entry.wrong(expected)) };
    let numbers = numbers.iter().map(Entry::number).collect::<Result<Vec<_>>>()?;
    let [w, x, y, z, tx, ty, tz, id] = numbers[..] else { return Err(entry.wrong(expected)) };
    Ok((Pose { rotation: entry.quaternion([w, x, y, z])?, translation: [tx, ty, tz] }, id))
}

/// Reads a line of `images.txt`: image number, quaternion, translation, camera number, name.
fn image<'a>(entry: Entry<'a>, cameras: &Entry) -> Result<Posed<'a>> {
    let (pose, id) = placed(&entry)?;
    let mut found = None;
    for camera in cameras.items()? {
        if camera.items()?.first().map(Entry::number).transpose()? == Some(id)
            && found.replace(self::camera(&camera)?).is_some()
        {
            return Err(camera.error(format_args!("is camera {id} again; keep one")));
        }
    }
    let (lens, size) =
        found.ok_or_else(|| entry.error(format_args!("is of camera {id}, which {CAMERAS} lacks")))?;
    Ok(Posed { lens, size: Some(size), pose, entry })
}

/// Reads a line of `cameras.txt`: number, model, width, height, parameters.
fn camera(entry: &Entry) -> Result<(Lens, (usize, usize))> {
    let wrong = || entry.wrong("CAMERA_ID, MODEL, WIDTH, HEIGHT and the parameters of the model");
    let words = entry.items()?;
    let [_, model, width, height, parameters @ ..] = &words[..] else { return Err(wrong()) };
    let p = parameters.iter().map(Entry::number).collect::<Result<Vec<_>>>()?;
    let name = model.word()?;
    if MODELS.iter().all(|known| *known != (name, p.len())) {
        return Err(wrong());
    }
    let simple = matches!(
        name,
        "SIMPLE_PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "SIMPLE_RADIAL_FISHEYE" | "RADIAL_FISHEYE"
    );
    let (focal_length, [cx, cy], k) = match p[..] {
        [f, cx, cy, ref k @ ..] if simple => ([f, f], [cx, cy], k),
        [fx, fy, cx, cy, ref k @ ..] => ([fx, fy], [cx, cy], k),
        _ => return Err(wrong()),
    };
    let c = |i: usize| k.get(i).copied().unwrap_or(0.0);
    let distortion = match name {
        "SIMPLE_RADIAL_FISHEYE" | "RADIAL_FISHEYE" | "OPENCV_FISHEYE" => {
            Distortion::Equidistant([c(0), c(1), c(2), c(3)])
        }
        "FOV" => Distortion::FieldOfView(c(0)),
        "THIN_PRISM_FISHEYE" => Distortion::ThinPrismFisheye {
            k: [c(0), c(1), c(4), c(5)],
            tangential: [c(2), c(3)],
            prism: [c(6), c(7)],
        },
        // OPENCV has no k3; RADIAL has only k1 and k2.
        _ => {
            let all = [c(0), c(1), c(2), c(3), c(4), c(5), c(6), c(7)];
            Distortion::RadialTangential(RadialTangential::polynomials(all))
        }
    };
    // COLMAP puts the centre of the top left pixel at (0.5, 0.5).
    let lens = Lens::new(focal_length, [cx - 0.5, cy - 0.5], distortion).map_err(|_| wrong())?;
    Ok((lens, (width.count()?, height.count()?)))
}
