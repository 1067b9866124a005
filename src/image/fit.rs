//! Images that are scaled or cropped from those of a calibration.

use std::fmt;

use super::Rect;

/// The mapping from the images of a calibration to others of the same camera: all or part of them, possibly scaled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Width and height of the calibrated images.
    pub calibrated: (usize, usize),
    /// Width and height of the other images.
    pub size: (usize, usize),
    /// The origin of the other images in the calibrated ones, in pixels from their outer corner.
    origin: [f64; 2],
    /// Pixels of the other images per calibrated pixel, horizontally and vertically.
    scale: [f64; 2],
}

impl Fit {
    /// The whole images, scaled; `None` if the aspect ratios differ.
    #[must_use]
    pub fn scaled(calibrated: (usize, usize), size: (usize, usize)) -> Option<Self> {
        /// The least difference of the scale from 1: an image that lacks a row is not a scaled one.
        const LEAST: f64 = 0.1;
        let scale = ratios(calibrated, size);
        let [width, height] = [calibrated.0, calibrated.1].map(|side| side as f64);
        let exact = calibrated.0 * size.1 == calibrated.1 * size.0;
        let rounded =
            (width * scale[1] - size.0 as f64).abs() < 1.0 || (height * scale[0] - size.1 as f64).abs() < 1.0;
        let fits = exact || rounded && (scale[0] - 1.0).abs() > LEAST;
        (fits && scale.iter().all(|scale| scale.is_finite() && *scale > 0.0)).then_some(Self {
            calibrated,
            size,
            origin: [0.0; 2],
            scale,
        })
    }

    /// The middle of the images, scaled to fill the others.
    pub(crate) fn middle(calibrated: (usize, usize), size: (usize, usize)) -> Self {
        let [across, down] = ratios(calibrated, size);
        Self::around_middle(calibrated, size, across.max(down))
    }

    /// The images centred in the others, and scaled to the same width.
    pub(crate) fn centred(calibrated: (usize, usize), size: (usize, usize)) -> Self {
        Self::around_middle(calibrated, size, ratios(calibrated, size)[0])
    }

    fn around_middle(calibrated: (usize, usize), size: (usize, usize), scale: f64) -> Self {
        let sides = [(calibrated.0, size.0), (calibrated.1, size.1)];
        let origin = sides.map(|(known, side)| (known as f64 - side as f64 / scale) / 2.0);
        Self { calibrated, size, origin, scale: [scale; 2] }
    }

    /// An unscaled part of the images.
    pub(crate) fn part(part: &Rect) -> Self {
        let (size, origin) = (part.size(), [part.x.start, part.y.start].map(|v| v as f64));
        Self { calibrated: size, size, origin, scale: [1.0; 2] }
    }

    /// Maps a position in the calibrated images. Both positions count from the centre of the top left pixel.
    pub(crate) fn place(&self, at: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|i| (at[i] + 0.5 - self.origin[i]) * self.scale[i] - 0.5)
    }

    /// Pixels of the other images per calibrated pixel, horizontally and vertically.
    pub(crate) fn scale(&self) -> [f64; 2] {
        self.scale
    }
}

fn ratios(calibrated: (usize, usize), size: (usize, usize)) -> [f64; 2] {
    [size.0 as f64 / calibrated.0 as f64, size.1 as f64 / calibrated.1 as f64]
}

impl fmt::Display for Fit {
    /// Continues a sentence that begins with the calibration.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { calibrated: (width, height), size: (w, h), origin, scale } = *self;
        write!(f, "is for images of {width} x {height}: those of {w} x {h} count as ")?;
        let is = |all: [f64; 2], one: f64| all.iter().all(|value| (value - one).abs() < f64::EPSILON);
        match (is(origin, 0.0), is(scale, 1.0)) {
            (true, _) => f.write_str("the same, scaled"),
            (false, true) => f.write_str("the middle of them"),
            (false, false) => {
                let [w, h] = [w as f64 / scale[0], h as f64 / scale[1]].map(f64::round);
                write!(f, "their middle {w} x {h}, scaled")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_near(found: [f64; 2], expected: [f64; 2]) -> bool {
        found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-9)
    }

    #[test]
    fn images_of_one_aspect_are_scaled() {
        for (calibrated, size, fits) in [
            ((1280, 960), (640, 480), true),
            ((640, 480), (1280, 960), true),
            ((1242, 375), (621, 187), true),
            ((1242, 375), (621, 188), true),
            ((240, 180), (241, 180), false),
            ((240, 180), (240, 179), false),
            ((1280, 800), (1280, 720), false),
            ((640, 480), (480, 640), false),
            ((0, 0), (640, 480), false),
            ((640, 480), (0, 0), false),
        ] {
            assert_eq!(Fit::scaled(calibrated, size).is_some(), fits, "{calibrated:?} {size:?}");
        }
    }

    #[test]
    fn pixels_are_scaled_about_the_outer_corner() {
        let half = Fit::scaled((1280, 960), (640, 480)).unwrap();
        // The middle of both, and the middle between the first two pixels in each direction.
        assert!(is_near(half.place([639.5, 479.5]), [319.5, 239.5]));
        assert!(is_near(half.place([0.5, 0.5]), [0.0, 0.0]));
    }

    #[test]
    fn the_middle_fills_an_image() {
        let of = |size| Fit::middle((1280, 800), size);
        assert!(is_near(of((1280, 720)).place([640.0, 400.0]), [640.0, 360.0]));
        assert_eq!(
            of((1280, 720)).to_string(),
            "is for images of 1280 x 800: those of 1280 x 720 count as the middle of them"
        );
        // Scaled by 0.6, as 480 is to 800.
        let narrow = of((640, 480));
        assert!(is_near(narrow.place([639.5, 399.5]), [319.5, 239.5]));
        assert!(narrow.to_string().ends_with("count as their middle 1067 x 800, scaled"), "{narrow}");
    }
}
