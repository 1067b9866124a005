//! Counts the pixels in which two matches differ in any of four maps. Each folder holds the output of `mrfgs match LEFT RIGHT map.pfm
//! --also raw,confidence,validity`. `cargo run --release --example differing-pixels FOLDER FOLDER` prints the number of pixels of a map,
//! and how many of them differ.
//!
//! `differing-pixels --flip FILE` flips the lowest bit of the middle pixel of a map.

use std::path::Path;
use std::process::ExitCode;

use image::{DynamicImage, GrayImage};
use mrfgs::image::Plane;
use mrfgs::image::pfm::{self, Pfm};

fn main() -> ExitCode {
    let args: Vec<_> = std::env::args().skip(1).collect();
    let args: Vec<_> = args.iter().map(String::as_str).collect();
    let result = match args[..] {
        ["--flip", file] => flip(Path::new(file)),
        [a, b] => {
            count(Path::new(a), Path::new(b)).map(|(pixels, differing)| println!("{pixels} {differing}"))
        }
        _ => Err("give FOLDER FOLDER, or --flip FILE".into()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("differing-pixels: {reason}");
            ExitCode::FAILURE
        }
    }
}

fn count(a: &Path, b: &Path) -> Result<(usize, usize), String> {
    let mut differs: Option<Plane<bool>> = None;
    for name in ["map.pfm", "map.raw.pfm", "map.confidence.png", "map.validity.png"] {
        let (a, b) = (read(&a.join(name))?, read(&b.join(name))?);
        let size = differs.as_ref().map_or(a.size(), Plane::size);
        if a.size() != size || b.size() != size {
            return Err(format!("{name} has another size than the other maps"));
        }
        let differs = differs.get_or_insert_with(|| Plane::filled(size.0, size.1, false));
        for ((differs, a), b) in differs.data_mut().iter_mut().zip(a.data()).zip(b.data()) {
            *differs |= a != b;
        }
    }
    let differs = differs.unwrap_or_else(|| Plane::filled(0, 0, false));
    Ok((differs.data().len(), differs.data().iter().filter(|&&differs| differs).count()))
}

fn flip(file: &Path) -> Result<(), String> {
    let mut map = read(file)?;
    let middle = map.data().len() / 2;
    map.data_mut()[middle] ^= 1;
    if is_pfm(file) {
        return pfm::write(file, &map.map(|&bits| f32::from_bits(bits))).map_err(|e| e.to_string());
    }
    let (width, height) = map.size();
    let levels = GrayImage::from_fn(width as u32, height as u32, |x, y| {
        image::Luma([map[(x as usize, y as usize)] as u8])
    });
    levels.save(file).map_err(|e| format!("cannot write {}: {e}", file.display()))
}

/// The bits of every pixel.
fn read(file: &Path) -> Result<Plane<u32>, String> {
    let wrong = |what: &str| Err(format!("{} is {what}", file.display()));
    if is_pfm(file) {
        return match pfm::read(file).map_err(|e| e.to_string())? {
            Pfm::Grey(map) => Ok(map.map(|value| value.to_bits())),
            _ => wrong("no map"),
        };
    }
    match image::open(file).map_err(|e| format!("cannot read {}: {e}", file.display()))? {
        DynamicImage::ImageLuma8(map) => {
            let (width, height) = (map.width() as usize, map.height() as usize);
            Ok(Plane::new(width, height, map.into_raw().into_iter().map(u32::from).collect()))
        }
        _ => wrong("no map of 8 bits"),
    }
}

fn is_pfm(file: &Path) -> bool {
    file.extension().is_some_and(|extension| extension == "pfm")
}
