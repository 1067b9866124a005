//! Turns images that are stored rotated.

use image::metadata;

#[cfg(not(target_arch = "wasm32"))]
use super::Rect;
use super::orientation::Orientation;
use super::raster::{Raster, Sample, Samples, of_any};
use crate::error::MemoryError;
use crate::memory;

impl Orientation {
    /// The orientation in the EXIF data of a file.
    pub(super) fn of_exif(data: &[u8]) -> Self {
        let known = metadata::Orientation::from_exif_chunk(data);
        known.map_or(Self::UPRIGHT, |known| Self::of_tag(known.to_exif().into()))
    }

    /// Whether columns are stored as rows.
    pub(super) fn is_sideways(self) -> bool {
        self.0 > 4
    }

    /// The stored position of the pixel (x, y) of the upright image, which has `size`.
    pub(super) fn stored(self, (x, y): (usize, usize), (width, height): (usize, usize)) -> (usize, usize) {
        let (right, bottom) = (width - 1 - x, height - 1 - y);
        match self.0 {
            2 => (right, y),
            3 => (right, bottom),
            4 => (x, bottom),
            5 => (y, x),
            6 => (y, right),
            7 => (bottom, right),
            8 => (bottom, x),
            _ => (x, y),
        }
    }

    /// The size of the upright image, from that of the stored one, or the other way.
    pub(super) fn turned(self, (width, height): (usize, usize)) -> (usize, usize) {
        if self.is_sideways() { (height, width) } else { (width, height) }
    }
}

/// For parts of images in files.
#[cfg(not(target_arch = "wasm32"))]
impl Orientation {
    /// The orientation of the stored image that the upright one has, taken as stored.
    pub(super) fn inverse(self) -> Self {
        match self.0 {
            6 => Self(8),
            8 => Self(6),
            _ => self,
        }
    }

    /// The stored place of `part`, which is not empty, of an upright image of `size`.
    pub(super) fn stored_part(self, part: &Rect, size: (usize, usize)) -> Rect {
        let ends = [(part.x.start, part.y.start), (part.x.end - 1, part.y.end - 1)];
        let [(a, b), (c, d)] = ends.map(|at| self.stored(at, size));
        Rect { x: a.min(c)..a.max(c) + 1, y: b.min(d)..b.max(d) + 1 }
    }
}

impl Raster<'_> {
    /// The image rotated upright by its orientation tag; if that changes it, without its georeference.
    pub(super) fn upright(self) -> Result<Self, MemoryError> {
        fn turned<S: Copy>(
            values: &[S],
            each: usize,
            by: Orientation,
            (width, height): (usize, usize),
        ) -> Result<Vec<S>, MemoryError> {
            let row = if by.is_sideways() { height } else { width };
            let mut out = memory::reserved(values.len())?;
            for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                let (u, v) = by.stored((x, y), (width, height));
                out.extend_from_slice(&values[(v * row + u) * each..][..each]);
            }
            Ok(out)
        }
        let (by, n) = (self.orientation, self.channels);
        if by.is_upright() {
            return Ok(self);
        }
        let size = by.turned(self.size());
        let samples = of_any!(&self.samples, v => Sample::samples(turned(v, n, by, size)?.into()));
        let no_data = self.no_data.as_ref().map(|marked| turned(marked, 1, by, size)).transpose()?;
        Ok(Self { no_data, doubt: self.doubt, ..Self::of(size, n, samples) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{DynamicImage, GrayImage};

    /// The crate `image` rotates in the same way.
    #[test]
    fn pixels_move_as_in_another_library() {
        for tag in 0..=9_u8 {
            let (width, height) = (3, 2);
            let stored = GrayImage::from_fn(width, height, |x, y| image::Luma([(10 * y + x) as u8]));
            let orientation = Orientation::of_tag(tag.into());
            let mut turned = DynamicImage::ImageLuma8(stored.clone());
            turned.apply_orientation(
                metadata::Orientation::from_exif(tag).unwrap_or(metadata::Orientation::NoTransforms),
            );
            let turned = turned.to_luma8();
            assert_eq!(orientation.is_sideways(), turned.width() != width, "{tag}");
            let size = (turned.width() as usize, turned.height() as usize);
            for (x, y, pixel) in turned.enumerate_pixels() {
                let (u, v) = orientation.stored((x as usize, y as usize), size);
                assert_eq!(stored[(u as u32, v as u32)], *pixel, "{tag}: {x}, {y}");
            }
        }
    }
}
