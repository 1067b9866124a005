//! Makes frames for the tests in C: `frames KIND FROM TO` writes the middle of a picture as PNM (KIND `rgb`, `grey` or `grey16`) or PFM
//! (KIND `float`). `frames map FROM TO` converts a grey map unchanged, and `frames whole FROM TO` a colour picture.

use image::{DynamicImage, ImageBuffer, ImageError, Luma};

type GrayImage16 = ImageBuffer<Luma<u16>, Vec<u16>>;

/// Width and height of a frame.
const SIZE: (u32, u32) = (122, 90);

fn main() -> Result<(), ImageError> {
    let args: Vec<_> = std::env::args().skip(1).collect();
    let args: Vec<_> = args.iter().map(String::as_str).collect();
    let [kind, from, to] = args[..] else {
        eprintln!("frames: give KIND FROM TO");
        std::process::exit(2)
    };
    let picture = image::open(from)?;
    match kind {
        "map" => write(to, &picture),
        "whole" => write(to, &picture.to_rgb8().into()),
        "float" => write_float(to, &frame(&picture, "grey16").to_luma16()),
        kind => write(to, &frame(&picture, kind)),
    }
}

fn frame(picture: &DynamicImage, kind: &str) -> DynamicImage {
    let (x, y) = ((picture.width() - SIZE.0) / 2, (picture.height() - SIZE.1) / 2);
    let frame = picture.crop_imm(x, y, SIZE.0, SIZE.1);
    match kind {
        "grey" => frame.to_luma8().into(),
        "grey16" => {
            let mut frame = frame.to_luma16();
            // Values that are not multiples of 257, which would be equivalent to 8 bits.
            frame.pixels_mut().for_each(|pixel| pixel.0[0] /= 23);
            frame.into()
        }
        _ => frame.to_rgb8().into(),
    }
}

fn write(to: &str, picture: &DynamicImage) -> Result<(), ImageError> {
    let (kind, white, samples) = match picture {
        DynamicImage::ImageLuma8(picture) => (5, 255, picture.as_raw().clone()),
        DynamicImage::ImageLuma16(picture) => {
            (5, 65_535, picture.as_raw().iter().flat_map(|value| value.to_be_bytes()).collect())
        }
        picture => (6, 255, picture.to_rgb8().into_raw()),
    };
    let head = format!("P{kind}\n{} {}\n{white}\n", picture.width(), picture.height());
    Ok(std::fs::write(to, [head.into_bytes(), samples].concat())?)
}

/// Rows from bottom to top.
fn write_float(to: &str, picture: &GrayImage16) -> Result<(), ImageError> {
    let mut bytes = format!("Pf\n{} {}\n-1.0\n", picture.width(), picture.height()).into_bytes();
    for row in picture.as_raw().chunks(picture.width() as usize).rev() {
        bytes.extend(row.iter().flat_map(|value| (f32::from(*value) / 7.0).to_le_bytes()));
    }
    Ok(std::fs::write(to, bytes)?)
}
