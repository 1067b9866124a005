//! Re-creates everything that `testdata/` holds: `cargo run --release --example render-scenes [folder]`.

#[path = "scenes.rs"]
mod scenes;

use std::fs::{self, File};
use std::io::{BufWriter, Result, Write};
use std::path::{Path, PathBuf};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use mrfgs::image::Plane;

fn main() -> Result<()> {
    let folder = match std::env::args_os().nth(1) {
        Some(folder) => PathBuf::from(folder),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("testdata"),
    };
    for recipe in scenes::all() {
        let scene = recipe.render();
        let folder = folder.join(scene.name);
        fs::create_dir_all(&folder)?;
        let size = scene.left.size();
        write_png(&folder.join("im0.png"), size, scene.left.data().as_flattened(), ExtendedColorType::Rgb8)?;
        write_png(&folder.join("im1.png"), size, scene.right.data().as_flattened(), ExtendedColorType::Rgb8)?;
        write_png(&folder.join("mask0nocc.png"), size, scene.mask.data(), ExtendedColorType::L8)?;
        write_pfm(&folder.join("disp0GT.pfm"), &scene.truth)?;
        let calib = format!("width={}\nheight={}\nndisp={}\n", size.0, size.1, scene.labels);
        fs::write(folder.join("calib.txt"), calib)?;
        println!("{}", folder.display());
    }
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
        .map_err(std::io::Error::other)?;
    file.flush()
}

/// One channel, little-endian, bottom row first.
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
