//! The orientation of a stored image: the tag Orientation of EXIF and TIFF.

/// The orientation of a stored image, from the tag `Orientation` of EXIF and TIFF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Orientation(pub(super) u8);

impl Orientation {
    /// Stored upright.
    pub const UPRIGHT: Self = Self(1);

    /// The orientation of a tag, 1 to 8; other numbers, which are invalid, count as upright.
    #[must_use]
    pub fn of_tag(tag: u64) -> Self {
        if (1..=8).contains(&tag) { Self(tag as u8) } else { Self::UPRIGHT }
    }

    /// Whether the image is stored upright.
    #[must_use]
    pub fn is_upright(self) -> bool {
        self == Self::UPRIGHT
    }
}
