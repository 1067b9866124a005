//! Frames for the tests in C: `frames KIND FROM TO` writes the middle of a picture as PNM; KIND is `rgb`, `grey`, or `grey16` for 16
//! bits. `frames map FROM TO` writes a grey map as it is.

use image::{DynamicImage, ImageError};

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
    write(to, &if kind == "map" { picture } else { frame(&picture, kind) })
}

fn frame(picture: &DynamicImage, kind: &str) -> DynamicImage {
    let (x, y) = ((picture.width() - SIZE.0) / 2, (picture.height() - SIZE.1) / 2);
    let frame = picture.crop_imm(x, y, SIZE.0, SIZE.1);
    match kind {
        "grey" => frame.to_luma8().into(),
        "grey16" => {
            let mut frame = frame.to_luma16();
            // Values that are no multiples of 257, which would stand for 8 bits.
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
