//! Types that can be written as PNG files.

use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use super::{Image, Plane};
use crate::error::{Error, Result};

/// The contents of a PNG file: 8-bit or 16-bit grey levels, such as depths in millimetres, 8-bit colours
/// (red, green, blue), or an image for the matcher.
pub trait Picture {
    /// The bytes of the file, which errors call `path`.
    ///
    /// # Errors
    /// [`Error::Write`] when PNG cannot hold a picture of this size.
    fn png(&self, path: &Path) -> Result<Vec<u8>>;
}

macro_rules! planes {
    ($($pixel:ty: $kind:ident),*) => {
        $(impl Picture for Plane<$pixel> {
            fn png(&self, path: &Path) -> Result<Vec<u8>> {
                png(path, bytemuck::cast_slice(self.data()), self.size(), ExtendedColorType::$kind)
            }
        })*
    };
}

planes!(u8: L8, u16: L16, [u8; 3]: Rgb8);

/// Reading the file gives the same pixels: it is grey if all colours are, with 8 bits if all levels have at
/// most 8, else with 16, and with alpha if a pixel is masked.
impl Picture for Image {
    fn png(&self, path: &Path) -> Result<Vec<u8>> {
        let pixels = self.pixels.data();
        let is_grey = pixels.iter().all(|[r, g, b, _]| r == g && g == b);
        let is_bytes = self.holds_bytes();
        let has_alpha = self.any_masked();
        let mut samples: Vec<u16> = Vec::with_capacity(pixels.len() * 4);
        for (pixel, masked) in pixels.iter().zip(self.masked.data()) {
            samples.extend(&pixel[..if is_grey { 1 } else { 3 }]);
            samples.extend(has_alpha.then_some(if *masked { 0 } else { u16::MAX }));
        }
        let kind = match (is_grey, has_alpha, is_bytes) {
            (true, false, true) => ExtendedColorType::L8,
            (true, true, true) => ExtendedColorType::La8,
            (false, false, true) => ExtendedColorType::Rgb8,
            (false, true, true) => ExtendedColorType::Rgba8,
            (true, false, false) => ExtendedColorType::L16,
            (true, true, false) => ExtendedColorType::La16,
            (false, false, false) => ExtendedColorType::Rgb16,
            (false, true, false) => ExtendedColorType::Rgba16,
        };
        if is_bytes {
            let bytes: Vec<u8> = samples.iter().map(|v| (v >> 8) as u8).collect();
            png(path, &bytes, self.pixels.size(), kind)
        } else {
            png(path, bytemuck::cast_slice(&samples), self.pixels.size(), kind)
        }
    }
}

/// Encodes a PNG file; 16-bit samples are in native byte order.
pub(super) fn png(
    path: &Path,
    samples: &[u8],
    size: (usize, usize),
    kind: ExtendedColorType,
) -> Result<Vec<u8>> {
    let (w, h) = png_or_tiff_size(path, size)?;
    let mut bytes = Vec::new();
    let written = PngEncoder::new(&mut bytes).write_image(samples, w, h, kind);
    written.map_err(|e| Error::write(path, e.to_string()))?;
    Ok(bytes)
}

pub(super) fn png_or_tiff_size(path: &Path, size: (usize, usize)) -> Result<(u32, u32)> {
    match (u32::try_from(size.0), u32::try_from(size.1)) {
        (Ok(w), Ok(h)) if w > 0 && h > 0 => Ok((w, h)),
        _ => {
            Err(Error::write(path, format!("the format holds no picture of {} x {} pixels", size.0, size.1)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Pair, grey, write};
    use super::*;

    #[test]
    fn images_survive_a_round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        for (colours, masked, step) in [
            (false, false, 256),
            (true, false, 256),
            (false, true, 256),
            (true, true, 256),
            (true, true, 1),
            (false, true, 1),
        ] {
            let mut image = Image {
                pixels: Plane::from_fn(19, 14, |x, y| {
                    let v = ((x * 2713 + y * 911 + 40_003) % 65_281 / step * step) as u16;
                    let [r, g, b] = if colours { [v, v / 512 * 256, 256] } else { [v; 3] };
                    [r, g, b, grey(r, g, b)]
                }),
                masked: Plane::filled(19, 14, false),
            };
            if masked {
                (image.pixels[(3, 2)], image.masked[(3, 2)]) = ([0; 4], true);
            }
            write::picture(&path, &image).unwrap();
            let again = Pair::open(&path, &path).unwrap();
            assert_eq!(*again.left(), image, "{colours} {masked} {step}");
        }
    }
}
