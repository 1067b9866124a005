//! What a lens does to a ray.

use crate::error::{Error, Result};

/// A camera with its lens: where a ray meets the image. Pixels count from the centre of the top left one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Focal length across and down, in pixels.
    pub(crate) focal_length: [f64; 2],
    /// Where the optical axis meets the image, in pixels.
    pub(crate) principal_point: [f64; 2],
    pub(crate) distortion: Distortion,
    /// How far from the axis the lens is known: the tangent of the angle. Beyond, its polynomial turns back.
    reach: f64,
}

/// How a lens departs from a pinhole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// Radial and tangential, as OpenCV's: `plumb_bob`, `rational_polynomial`, `radtan`.
    RadialTangential {
        /// k1 to k6.
        radial: [f64; 6],
        /// p1 and p2.
        tangential: [f64; 2],
    },
    /// Fisheye: the angle to the axis times a polynomial of its square, k1 to k4. OpenCV's `fisheye`, `equidistant`.
    Equidistant([f64; 4]),
}

impl Distortion {
    /// Of a pinhole.
    pub const NONE: Self = Self::RadialTangential { radial: [0.0; 6], tangential: [0.0; 2] };

    /// The coefficients of the order k1, k2, p1, p2, k3 to k6, as most files have them: 4, 5 or 8, or more that are 0. The
    /// error says what was expected.
    pub(crate) fn radial_tangential(coefficients: &[f64]) -> std::result::Result<Self, &'static str> {
        if !matches!(coefficients.len(), 0 | 4 | 5 | 8 | 12 | 14) {
            return Err("4, 5 or 8 coefficients: k1, k2, p1, p2, then k3, then k4 to k6");
        }
        if coefficients.iter().skip(8).any(|&c| c != 0.0) {
            return Err("no thin prism and no tilt, coefficients 9 to 14; calibrate without them");
        }
        let c = |i: usize| coefficients.get(i).copied().unwrap_or(0.0);
        let radial = [c(0), c(1), c(4), c(5), c(6), c(7)];
        Ok(Self::RadialTangential { radial, tangential: [c(2), c(3)] })
    }
}

/// The numerator and denominator of the radial factor at the square `r2` of the radius.
fn radial_factor([k1, k2, k3, k4, k5, k6]: [f64; 6], r2: f64) -> [f64; 2] {
    [1.0 + ((k3 * r2 + k2) * r2 + k1) * r2, 1.0 + ((k6 * r2 + k5) * r2 + k4) * r2]
}

/// The radius in the image of what is `angle` away from the axis, and its derivative.
fn equidistant([k1, k2, k3, k4]: [f64; 4], angle: f64) -> [f64; 2] {
    let a2 = angle * angle;
    let radius = angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))));
    [radius, 1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + a2 * 9.0 * k4)))]
}

impl Lens {
    /// A lens with this focal length across and down, principal point (both in pixels) and distortion.
    ///
    /// # Errors
    /// [`Error::Calibration`] when a number is not finite or a focal length not above 0.
    pub fn new(focal_length: [f64; 2], principal_point: [f64; 2], distortion: Distortion) -> Result<Self> {
        let coefficients = match distortion {
            Distortion::RadialTangential { radial, tangential } => [radial.as_slice(), &tangential].concat(),
            Distortion::Equidistant(k) => k.to_vec(),
        };
        let numbers = focal_length.iter().chain(&principal_point).chain(&coefficients);
        if !numbers.into_iter().all(|v| v.is_finite()) || focal_length.iter().any(|&f| f <= 0.0) {
            return Err(Error::Calibration(format!(
                "has a lens of focal lengths {focal_length:?} and distortion {coefficients:?}, which no camera has"
            )));
        }
        Ok(Self { focal_length, principal_point, distortion, reach: reach(distortion) })
    }

    /// Where the ray (x, y, z), z forward, meets the image. `None` for a ray from behind, and so far from the axis that the
    /// polynomial of the lens has turned back.
    #[must_use]
    pub fn project(&self, [x, y, z]: [f64; 3]) -> Option<[f64; 2]> {
        let (x, y) = (x / z, y / z);
        let r2 = x * x + y * y;
        let inside = z > 0.0 && r2 <= self.reach * self.reach;
        inside.then(|| self.pixel(self.distorted([x, y], r2))).filter(|at| at.iter().all(|v| v.is_finite()))
    }

    fn distorted(&self, [x, y]: [f64; 2], r2: f64) -> [f64; 2] {
        match self.distortion {
            Distortion::RadialTangential { radial, tangential: [p1, p2] } => {
                let [above, below] = radial_factor(radial, r2);
                let factor = above / below;
                [
                    x * factor + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                    y * factor + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
                ]
            }
            Distortion::Equidistant(k) => {
                let r = r2.sqrt();
                let factor = if r == 0.0 { 1.0 } else { equidistant(k, libm::atan(r))[0] / r };
                [x * factor, y * factor]
            }
        }
    }

    fn pixel(&self, at: [f64; 2]) -> [f64; 2] {
        std::array::from_fn(|i| self.focal_length[i] * at[i] + self.principal_point[i])
    }

    /// About where the ray of a pixel meets the plane z = 1, as near as OpenCV's `undistortPoints` comes in its default number
    /// of steps. The frame of a rectified view follows from such points, and is so the same as OpenCV's.
    pub(crate) fn nearly_undistorted(&self, pixel: [f64; 2]) -> [f64; 2] {
        let start: [f64; 2] =
            std::array::from_fn(|i| (pixel[i] - self.principal_point[i]) / self.focal_length[i]);
        match self.distortion {
            Distortion::RadialTangential { radial, tangential: [p1, p2] } => {
                let [mut x, mut y] = start;
                for _ in 0..5 {
                    let r2 = x * x + y * y;
                    let [above, below] = radial_factor(radial, r2);
                    let factor = below / above;
                    if factor < 0.0 {
                        return start;
                    }
                    let dx = 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
                    let dy = p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
                    (x, y) = ((start[0] - dx) * factor, (start[1] - dy) * factor);
                }
                [x, y]
            }
            Distortion::Equidistant(k) => {
                let radius = (start[0] * start[0] + start[1] * start[1]).sqrt();
                let radius = radius.min(std::f64::consts::FRAC_PI_2);
                if radius <= 1e-8 {
                    return start;
                }
                let mut angle = radius;
                for _ in 0..10 {
                    let [found, slope] = equidistant(k, angle);
                    angle -= (found - radius) / slope;
                }
                start.map(|v| v * libm::tan(angle) / radius)
            }
        }
    }

    /// Whether it is a fisheye.
    pub(crate) fn is_fisheye(&self) -> bool {
        matches!(self.distortion, Distortion::Equidistant(_))
    }
}

/// The tangent of the angle to the axis up to which the radius in the image grows with the angle.
fn reach(distortion: Distortion) -> f64 {
    const STEPS: i32 = 4096;
    // The last step would be at a right angle.
    let tangents = (1..STEPS).map(|i| {
        let angle = f64::from(i) / f64::from(STEPS) * std::f64::consts::FRAC_PI_2;
        (angle, libm::tan(angle))
    });
    let grows = |(angle, tangent): &(f64, f64)| match distortion {
        Distortion::RadialTangential { radial: k, .. } => {
            let r2 = tangent * tangent;
            let [above, below] = radial_factor(k, r2);
            let slope = |[a, b, c]: [f64; 3]| a + r2 * (2.0 * b + r2 * 3.0 * c);
            let slopes = [slope([k[0], k[1], k[2]]), slope([k[3], k[4], k[5]])];
            below > 0.0
                && above > 0.0
                && above * below + 2.0 * r2 * (slopes[0] * below - above * slopes[1]) > 0.0
        }
        Distortion::Equidistant(k) => equidistant(k, *angle)[1] > 0.0,
    };
    tangents.take_while(grows).last().map_or(0.0, |(_, tangent)| tangent)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lens(distortion: Distortion) -> Lens {
        Lens::new([500.0, 510.0], [320.0, 240.0], distortion).unwrap()
    }

    #[test]
    fn a_pinhole_sees_straight() {
        let lens = lens(Distortion::NONE);
        assert_eq!(lens.project([0.5, -0.25, 1.0]), Some([570.0, 112.5]));
        assert_eq!(lens.project([1.0, -0.5, 2.0]), Some([570.0, 112.5]));
        assert_eq!(lens.project([0.5, 0.25, -1.0]), None);
        assert_eq!(lens.project([0.5, 0.25, 0.0]), None);
        let [x, y] = lens.nearly_undistorted([570.0, 112.5]);
        assert!((x - 0.5).abs() < 1e-15 && (y + 0.25).abs() < 1e-15, "{x} {y}");
    }

    #[test]
    fn distortion_goes_by_the_formulas() {
        // r2 = 0.25 + 0.0625; worked out by hand from the formulas of OpenCV's manual.
        let radial = lens(Distortion::radial_tangential(&[-0.2, 0.04, 0.001, 0.002, -0.01]).unwrap());
        let (x, y, r2) = (0.5, -0.25, 0.3125_f64);
        let factor = 1.0 - 0.2 * r2 + 0.04 * r2 * r2 - 0.01 * r2 * r2 * r2;
        let expected = [
            500.0 * (x * factor + 2.0 * 0.001 * x * y + 0.002 * (r2 + 2.0 * x * x)) + 320.0,
            510.0 * (y * factor + 0.001 * (r2 + 2.0 * y * y) + 2.0 * 0.002 * x * y) + 240.0,
        ];
        let found = radial.project([x, y, 1.0]).unwrap();
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-10), "{found:?} {expected:?}");
        // A fisheye without coefficients: the radius is the angle.
        let found = lens(Distortion::Equidistant([0.0; 4])).project([1.0, 0.0, 1.0]).unwrap();
        assert!((found[0] - 320.0 - 500.0 * std::f64::consts::FRAC_PI_4).abs() < 1e-10, "{found:?}");
    }

    #[test]
    fn undistortion_undoes_weak_distortion() {
        for distortion in [
            Distortion::radial_tangential(&[-0.05, 0.01, 0.001, -0.001, 0.0, 0.01, 0.0, 0.0]).unwrap(),
            Distortion::Equidistant([0.02, -0.01, 0.003, 0.0]),
        ] {
            let lens = lens(distortion);
            let pixel = lens.project([0.3, -0.2, 1.0]).unwrap();
            let [x, y] = lens.nearly_undistorted(pixel);
            assert!((x - 0.3).abs() < 1e-5 && (y + 0.2).abs() < 1e-5, "{distortion:?}: {x} {y}");
        }
    }

    #[test]
    fn where_the_polynomial_turns_back_there_is_nothing() {
        // r (1 - 0.5 r2) grows up to r = 0.816.
        let lens = lens(Distortion::radial_tangential(&[-0.5, 0.0, 0.0, 0.0]).unwrap());
        assert!(lens.project([0.81, 0.0, 1.0]).is_some() && lens.project([0.82, 0.0, 1.0]).is_none());
    }

    #[test]
    fn coefficients_are_told_by_their_number() {
        for count in [1, 2, 3, 6, 7, 9, 15] {
            assert!(Distortion::radial_tangential(&vec![0.0; count]).is_err(), "{count}");
        }
        let mut prism = [0.0; 14];
        assert_eq!(Distortion::radial_tangential(&prism).unwrap(), Distortion::NONE);
        prism[9] = 1e-4;
        assert!(Distortion::radial_tangential(&prism).unwrap_err().contains("thin prism"));
        assert!(Lens::new([0.0, 1.0], [0.0; 2], Distortion::NONE).is_err());
        assert!(Lens::new([1.0, f64::NAN], [0.0; 2], Distortion::NONE).is_err());
    }
}
