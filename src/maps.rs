//! The maps that a match computes, and the meaning of their pixels.

use crate::image::{Plane, Rect};
use crate::options::MAX_DISPARITY;

/// Fixed-point units of disparity in one pixel.
pub const FRACTION: i32 = 256;

/// The bits of the validity map: the reasons for the state of a pixel. A pixel of 0 is measured and trusted.
pub mod flag {
    /// The match is outside the right image.
    pub const OUTSIDE: u8 = 1;
    /// The right view disagrees: occluded, or mistaken.
    pub const OCCLUDED: u8 = 2;
    /// The pixel is in a region too small to be trusted.
    pub const SPECKLE: u8 = 4;
    /// The confidence is below the floor; the disparity stays.
    pub const LOW_CONFIDENCE: u8 = 8;
    /// The disparity is filled in from other pixels. Alone, without a reason: no match was trusted, and a
    /// [prior](crate::prior::Prior) decided.
    pub const FILLED: u8 = 16;
    /// The pixel is masked in the input, and has no disparity.
    pub const MASKED: u8 = 32;
    /// Two labels match equally well.
    pub const TIE: u8 = 64;
    /// The pixels around it outvote the disparity, and it is filled in from them.
    pub const OUTVOTED: u8 = 128;
    /// Any of the reasons for which a disparity is given up. A pixel has at most one of them.
    pub const INVALID: u8 = OUTSIDE | OCCLUDED | SPECKLE | MASKED | TIE | OUTVOTED;
}

/// The bits of the validity map, each with its name and meaning; 0 stands for a pixel without any.
pub const REASONS: [(u8, &str, &str); 9] = [
    (0, "measured", "found in both views and trusted"),
    (flag::OUTSIDE, "outside", "the match is outside the right image"),
    (flag::OCCLUDED, "occluded", "the right view disagrees: hidden there, or mistaken"),
    (flag::SPECKLE, "small region", "in a region too small to be trusted"),
    (flag::TIE, "tie", "two disparities match equally well"),
    (flag::OUTVOTED, "outvoted", "the pixels around it agree on another disparity, which it has taken"),
    (
        flag::LOW_CONFIDENCE,
        "low confidence",
        "another disparity is nearly as good, or the pixels around it show others",
    ),
    (flag::FILLED, "filled", "taken from pixels around it"),
    (flag::MASKED, "masked", "the image holds no data here"),
];

/// The maps of a match, all of the size of the images.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Maps {
    /// The final disparity in 1/256 px; meaningless where [`has_disparity`] says no.
    pub disparity: Plane<i32>,
    /// The disparity before post-processing, in 1/256 px, of every pixel that is not masked.
    pub raw: Plane<i32>,
    /// Confidence 0 ..= 255.
    pub confidence: Plane<u8>,
    /// Bits of [`flag`].
    pub validity: Plane<u8>,
    /// The map of the right view; `None` unless
    /// [`RefinementOptions::right_map`](crate::options::RefinementOptions::right_map) asks for it.
    pub right: Option<RightMap>,
}

/// The disparity map of the right view: right (x, y) with disparity d is seen at left (x + d, y).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RightMap {
    /// The disparity in 1/256 px; meaningless where [`has_disparity`] says no.
    pub disparity: Plane<i32>,
    /// Bits of [`flag`] with the views exchanged; never low confidence.
    pub validity: Plane<u8>,
}

/// Whether a pixel with these validity bits has a disparity.
#[must_use]
pub fn has_disparity(validity: u8) -> bool {
    validity & flag::INVALID == 0 || validity & flag::FILLED != 0
}

/// Whether a pixel with these validity bits is filled from the pixels around it; one that a prior decided is not.
#[must_use]
pub(crate) fn is_filled(validity: u8) -> bool {
    validity & flag::INVALID != 0 && validity & flag::FILLED != 0
}

impl Maps {
    /// Maps from a disparity map in pixels, of a match or of another matcher, rounded to 1/256 px. Pixels
    /// without a finite disparity within [`MAX_DISPARITY`] are masked. The raw map equals the final one.
    ///
    /// # Panics
    /// When the maps differ in size.
    #[must_use]
    pub fn from_pixels(disparity: &Plane<f32>, confidence: Plane<u8>, mut validity: Plane<u8>) -> Self {
        assert_eq!([confidence.size(), validity.size()], [disparity.size(); 2], "maps of one image");
        let known = |d: f32| d.is_finite() && d.abs() <= MAX_DISPARITY as f32;
        for (validity, d) in validity.data_mut().iter_mut().zip(disparity.data()) {
            *validity = if known(*d) { *validity } else { flag::MASKED };
        }
        // Floats represent every disparity of a match exactly.
        let disparity = disparity.map(|d| if known(*d) { (d * FRACTION as f32).round() as i32 } else { 0 });
        Self { raw: disparity.clone(), disparity, confidence, validity, right: None }
    }

    /// Maps of (width, height) pixels that hold zeros, with that of the right view if `right`: parts of them can be
    /// [pasted](Self::paste).
    #[must_use]
    pub fn blank((width, height): (usize, usize), right: bool) -> Self {
        let (disparity, bytes) = (Plane::filled(width, height, 0), Plane::filled(width, height, 0));
        Self {
            raw: disparity.clone(),
            confidence: bytes.clone(),
            right: right.then(|| RightMap { disparity: disparity.clone(), validity: bytes.clone() }),
            disparity,
            validity: bytes,
        }
    }

    /// Copies `maps`, which have the size of `part`, to that part. The right view's are copied if both have some.
    ///
    /// # Panics
    /// When they have another size, or `part` is not inside.
    pub fn paste(&mut self, maps: &Self, part: &Rect) {
        self.disparity.paste(&maps.disparity, part);
        self.raw.paste(&maps.raw, part);
        self.confidence.paste(&maps.confidence, part);
        self.validity.paste(&maps.validity, part);
        if let (Some(whole), Some(right)) = (&mut self.right, &maps.right) {
            whole.disparity.paste(&right.disparity, part);
            whole.validity.paste(&right.validity, part);
        }
    }

    /// The top left part of (width, height) pixels.
    pub(crate) fn cut_to(self, size: (usize, usize)) -> Self {
        Self {
            disparity: self.disparity.cut_to(size),
            raw: self.raw.cut_to(size),
            confidence: self.confidence.cut_to(size),
            validity: self.validity.cut_to(size),
            right: self.right.map(|right| RightMap {
                disparity: right.disparity.cut_to(size),
                validity: right.validity.cut_to(size),
            }),
        }
    }

    /// The maps of `part`.
    #[must_use]
    pub fn crop(&self, part: &Rect) -> Self {
        Self {
            disparity: self.disparity.crop(part),
            raw: self.raw.crop(part),
            confidence: self.confidence.crop(part),
            validity: self.validity.crop(part),
            right: self.right.as_ref().map(|right| RightMap {
                disparity: right.disparity.crop(part),
                validity: right.validity.crop(part),
            }),
        }
    }

    /// The final map in pixels, `+inf` where there is none.
    #[must_use]
    pub fn final_map(&self) -> Plane<f32> {
        pixels(&self.disparity, &self.validity, has_disparity)
    }

    /// The final map of the right view in pixels, `+inf` where there is none; `None` if it was not asked for.
    #[must_use]
    pub fn right_map(&self) -> Option<Plane<f32>> {
        self.right.as_ref().map(|right| pixels(&right.disparity, &right.validity, has_disparity))
    }

    /// The map before post-processing in pixels, `+inf` on masked pixels.
    #[must_use]
    pub fn raw_map(&self) -> Plane<f32> {
        pixels(&self.raw, &self.validity, |validity| validity & flag::MASKED == 0)
    }
}

/// A map in pixels, `+inf` where its validity is not `known`.
fn pixels(fixed: &Plane<i32>, validity: &Plane<u8>, known: impl Fn(u8) -> bool) -> Plane<f32> {
    let (width, height) = fixed.size();
    Plane::from_fn(width, height, |x, y| {
        if known(validity[(x, y)]) { fixed[(x, y)] as f32 / FRACTION as f32 } else { f32::INFINITY }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_survive_a_round_trip_through_pixels() {
        let disparity = Plane::new(4, 1, vec![1000, -7, 3, 5]);
        let validity =
            Plane::new(4, 1, vec![0, flag::LOW_CONFIDENCE, flag::MASKED, flag::TIE | flag::FILLED]);
        let confidence = Plane::new(4, 1, vec![9, 1, 0, 0]);
        let maps = Maps { raw: disparity.clone(), disparity, confidence, validity, right: None };
        let back = |map: &Plane<f32>| Maps::from_pixels(map, maps.confidence.clone(), maps.validity.clone());
        let map = maps.final_map();
        assert_eq!(back(&map).final_map(), map);
        assert_eq!(back(&map).validity, maps.validity);

        // Disparities that a user removed count as missing, even filled ones, and so do unmatched ones.
        let taken = [f32::INFINITY, f32::NAN, 0.5, 2e6];
        let without = back(&Plane::new(4, 1, taken.to_vec()));
        assert_eq!(without.validity.data(), [flag::MASKED, flag::MASKED, flag::MASKED, flag::MASKED]);
        assert_eq!(without.final_map(), Plane::filled(4, 1, f32::INFINITY));
    }
}
