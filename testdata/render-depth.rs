//! Colours a depth map (PFM): `cargo run --release --example render-depth DEPTH.pfm PICTURE.png [BESIDE.png]`.
//!
//! Colours follow 1 / depth, like those of disparity maps; pixels without a depth are black. BESIDE, an image of the same view, is placed
//! on the left.

use std::path::Path;
use std::process::ExitCode;

use mrfgs::colour::{self, ColourMap};
use mrfgs::image::pfm::{self, Pfm};
use mrfgs::image::{read, write};

fn main() -> ExitCode {
    let args: Vec<_> = std::env::args().skip(1).collect();
    let args: Vec<_> = args.iter().map(Path::new).collect();
    let result = match args[..] {
        [depth, picture] => paint(depth, picture, None),
        [depth, picture, beside] => paint(depth, picture, Some(beside)),
        _ => Err("give DEPTH.pfm PICTURE.png [BESIDE.png]".into()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("render-depth: {reason}");
            ExitCode::FAILURE
        }
    }
}

fn paint(depth: &Path, picture: &Path, beside: Option<&Path>) -> Result<(), String> {
    let Pfm::Grey(depths) = pfm::read(depth).map_err(|e| e.to_string())? else {
        return Err(format!("{} has three channels; give a map of depths", depth.display()));
    };
    let nearness = depths.map(|depth| if depth.is_finite() { 1.0 / depth } else { f32::INFINITY });
    let known = || nearness.data().iter().copied().filter(|v| v.is_finite());
    let (least, most) = (known().fold(f32::MAX, f32::min), known().fold(f32::MIN, f32::max));
    let painted = colour::preview(&nearness, least, most, ColourMap::default());
    let painted = match beside {
        None => painted,
        Some(file) => {
            let left = read::Reader::default().pair(file, file, None).map_err(|e| e.to_string())?;
            colour::side_by_side(&left.left().to_rgb8(), &painted)
        }
    };
    write::picture(picture, &painted).map_err(|e| e.to_string())
}
