//! The orientation of a stored image: the tag Orientation of EXIF and TIFF.

use image::metadata;

/// The orientation of a stored image, from the tag `Orientation` of EXIF and TIFF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Orientation(u8);

impl Orientation {
    /// Stored upright.
    pub const UPRIGHT: Self = Self(1);

    /// The orientation of a tag, 1 to 8; other numbers, which are invalid, count as upright.
    #[must_use]
    pub fn of_tag(tag: u64) -> Self {
        if (1..=8).contains(&tag) { Self(tag as u8) } else { Self::UPRIGHT }
    }

    /// The orientation in the EXIF data of a file.
    pub(super) fn of_exif(data: &[u8]) -> Self {
        let known = metadata::Orientation::from_exif_chunk(data);
        known.map_or(Self::UPRIGHT, |known| Self::of_tag(known.to_exif().into()))
    }

    /// Whether the image is stored upright.
    #[must_use]
    pub fn is_upright(self) -> bool {
        self == Self::UPRIGHT
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
