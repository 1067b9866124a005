//! Regenerates the images of `testdata/`: `cargo run --release --example render-scenes [FOLDER]`.
//!
//! With the name of a scene and a size, it renders only that scene at any size:
//! `cargo run --release --example render-scenes FOLDER mixed 3000 2000 256`.
//!
//! With a number of frames, it renders the sequence `passing` or `moving`, which are not in `testdata/`, to the folders `left`, `right` and
//! `truth`: `cargo run --release --example render-scenes FOLDER passing 640 480 64 30`.

#[path = "raw.rs"]
mod raw;
#[path = "scenes.rs"]
mod scenes;

use std::fs::{self, File};
use std::io::{BufWriter, Error, Result, Write};
use std::path::{Path, PathBuf};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use mrfgs::image::Plane;

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let folder =
        args.first().map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("testdata"), PathBuf::from);
    match args.get(1..).unwrap_or_default() {
        [] => {
            scenes::ALL.iter().try_for_each(|recipe| save(&recipe.render(), &folder))?;
            save_raw(&folder.join("raw"))
        }
        [name] if name == "raw" => save_raw(&folder.join("raw")),
        [name, size @ ..] if size.len() == 4 => {
            let sequence = match name.as_str() {
                "passing" => scenes::passing,
                "moving" => scenes::moving,
                _ => return Err(usage()),
            };
            let numbers: std::result::Result<Vec<u32>, _> = size.iter().map(|n| n.parse()).collect();
            let Ok(&[width, height, labels, frames]) = numbers.as_deref() else { return Err(usage()) };
            let scenes = (0..frames).map(|step| sequence(step, width as usize, height as usize, labels));
            save_sequence(&folder, scenes)
        }
        [name, size @ ..] if size.len() == 3 => {
            let numbers: std::result::Result<Vec<u32>, _> = size.iter().map(|n| n.parse()).collect();
            let Ok(&[width, height, labels]) = numbers.as_deref() else { return Err(usage()) };
            save(&scenes::render(name, width as usize, height as usize, labels), &folder)
        }
        _ => Err(usage()),
    }
}

fn usage() -> Error {
    Error::other(
        "give [FOLDER [SCENE WIDTH HEIGHT LABELS]], or FOLDER passing WIDTH HEIGHT LABELS FRAMES (or moving)",
    )
}

/// Writes a scene in the layout of the Middlebury stereo benchmark.
fn save(scene: &scenes::Scene, folder: &Path) -> Result<()> {
    let folder = folder.join(scene.name);
    fs::create_dir_all(&folder)?;
    let size = scene.left.size();
    write_png(&folder.join("im0.png"), size, scene.left.data().as_flattened(), ExtendedColorType::Rgb8)?;
    write_png(&folder.join("im1.png"), size, scene.right.data().as_flattened(), ExtendedColorType::Rgb8)?;
    write_png(&folder.join("mask0nocc.png"), size, scene.mask.data(), ExtendedColorType::L8)?;
    write_pfm(&folder.join("disp0GT.pfm"), &scene.truth)?;
    fs::write(folder.join("calib.txt"), scene.calibration())?;
    if scene.name == "poster" {
        fs::write(folder.join("lidar.csv"), scene.lidar())?;
    }
    println!("{}", folder.display());
    Ok(())
}

/// Writes the frames of a sequence.
fn save_sequence(folder: &Path, frames: impl Iterator<Item = scenes::Scene>) -> Result<()> {
    for below in ["left", "right", "truth"] {
        fs::create_dir_all(folder.join(below))?;
    }
    for (step, scene) in frames.enumerate() {
        for (below, view) in [("left", &scene.left), ("right", &scene.right)] {
            let path = folder.join(format!("{below}/{step:06}.png"));
            write_png(&path, view.size(), view.data().as_flattened(), ExtendedColorType::Rgb8)?;
        }
        write_pfm(&folder.join(format!("truth/{step:06}.pfm")), &scene.truth)?;
    }
    println!("{}", folder.display());
    Ok(())
}

/// Writes the raw pair, the image of the third camera, and the calibrations.
fn save_raw(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder)?;
    let scene = raw::scene();
    for (name, camera, view) in
        [("left.png", &raw::CAMERAS[0], &scene.left), ("right.png", &raw::CAMERAS[1], &scene.right)]
    {
        let photograph = camera.photograph(raw::SIZE, view);
        write_png(&folder.join(name), raw::SIZE, photograph.data().as_flattened(), ExtendedColorType::Rgb8)?;
    }
    let text = raw::calibration(&raw::CAMERAS, raw::SIZE, raw::baseline(&scene));
    fs::write(folder.join("cameras.yml"), text)?;
    let third = &raw::THIRD;
    let pose = raw::third_pose(third, &raw::CAMERAS[0].turn);
    fs::write(folder.join("third.yml"), raw::third(third, raw::THIRD_SIZE, pose))?;
    let (size, eye) = (raw::THIRD_SIZE, raw::third_eye(&scene));
    let seen = scenes::world(scene.name).photograph(size, eye, 1.0 / third.focal, |x, y| third.ray(x, y));
    write_png(&folder.join("third.png"), size, seen.data().as_flattened(), ExtendedColorType::Rgb8)?;
    println!("{}", folder.display());
    Ok(())
}

fn write_png(
    path: &Path,
    (width, height): (usize, usize),
    bytes: &[u8],
    colour: ExtendedColorType,
) -> Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    PngEncoder::new_with_quality(&mut file, CompressionType::Best, FilterType::Adaptive)
        .write_image(bytes, width as u32, height as u32, colour)
        .map_err(Error::other)?;
    file.flush()
}

/// Writes one channel, little-endian, bottom row first.
fn write_pfm(path: &Path, plane: &Plane<f32>) -> Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    write!(file, "Pf\n{} {}\n-1.0\n", plane.width(), plane.height())?;
    for y in (0..plane.height()).rev() {
        for value in plane.row(y) {
            file.write_all(&value.to_le_bytes())?;
        }
    }
    file.flush()
}
