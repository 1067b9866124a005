//! Lens models.

mod radial_tangential;
mod wide;

use crate::error::{Error, Result};
use crate::image::calib::{Camera, Fit};

pub use radial_tangential::RadialTangential;

/// A camera with its lens: projects rays to pixels. Coordinates count from the centre of the top left pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Horizontal and vertical focal length, in pixels.
    pub(crate) focal_length: [f64; 2],
    /// Where the optical axis meets the image, in pixels.
    pub(crate) principal_point: [f64; 2],
    pub(crate) distortion: Distortion,
    /// The valid field: the tangent of the angle to the axis beyond which the image radius no longer grows.
    reach: f64,
}

/// The distortion of a lens.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Distortion {
    /// OpenCV's lenses: `plumb_bob`, `radtan`, `rational_polynomial`, also with thin prism and tilt.
    RadialTangential(RadialTangential),
    /// Fisheye: the angle to the axis times a polynomial of its square, k1 to k4. OpenCV's `fisheye`,
    /// `equidistant`, the model of Kannala and Brandt.
    Equidistant([f64; 4]),
    /// The fisheye, plus the terms of a decentred lens and a thin prism: COLMAP's `THIN_PRISM_FISHEYE`.
    ThinPrismFisheye {
        /// k1 to k4.
        k: [f64; 4],
        /// p1 and p2.
        tangential: [f64; 2],
        /// sx1 and sy1.
        prism: [f64; 2],
    },
    /// The unified model, `omni`, of Mei and Rives: a sphere seen from xi behind its centre, then radial and tangential distortion.
    Unified {
        /// The distance behind the centre.
        xi: f64,
        /// The distortion that follows the projection.
        then: RadialTangential,
    },
    /// Double sphere, `ds`.
    DoubleSphere {
        /// Distance between the spheres.
        xi: f64,
        /// Weight of the second sphere.
        alpha: f64,
    },
    /// The extended unified model, `eucm`. With a beta of 1 it is the unified one without distortion, `ucm`.
    ExtendedUnified {
        /// Weight of the ellipsoid.
        alpha: f64,
        /// Shape of the ellipsoid.
        beta: f64,
    },
    /// The field-of-view model, in radians: `fov`, `atan`.
    FieldOfView(f64),
}

impl Distortion {
    /// The distortion of a pinhole.
    pub const NONE: Self = Self::RadialTangential(RadialTangential::NONE);

    fn numbers(&self) -> Vec<f64> {
        match *self {
            Self::RadialTangential(model) => model.numbers(),
            Self::Equidistant(k) => k.to_vec(),
            Self::ThinPrismFisheye { k, tangential, prism } => [&k[..], &tangential, &prism].concat(),
            Self::Unified { xi, then } => [vec![xi], then.numbers()].concat(),
            Self::DoubleSphere { xi, alpha } => vec![xi, alpha],
            Self::ExtendedUnified { alpha, beta } => vec![alpha, beta],
            Self::FieldOfView(w) => vec![w],
        }
    }

    /// The image radius of a point at `tangent` from the axis in the plane z = 1, before tangential terms.
    fn radius(&self, tangent: f64) -> f64 {
        match *self {
            Self::RadialTangential(_) => tangent,
            Self::Equidistant(k) | Self::ThinPrismFisheye { k, .. } => {
                wide::equidistant(k, libm::atan(tangent))[0]
            }
            Self::Unified { xi, .. } => wide::unified(xi, tangent),
            Self::DoubleSphere { xi, alpha } => wide::double_sphere(xi, alpha, tangent),
            Self::ExtendedUnified { alpha, beta } => wide::extended_unified(alpha, beta, tangent),
            Self::FieldOfView(w) => wide::field_of_view(w, tangent),
        }
    }

    /// The image of a point of the plane z = 1, in focal lengths from the axis.
    fn distorted(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        if let Self::RadialTangential(model) = self {
            return model.distorted([x, y]);
        }
        let tangent = (x * x + y * y).sqrt();
        // On the axis, the factor does not matter.
        let factor = if tangent == 0.0 { 1.0 } else { self.radius(tangent) / tangent };
        let at = [x * factor, y * factor];
        match self {
            Self::Unified { then, .. } => then.distorted(at),
            Self::ThinPrismFisheye { tangential, prism, .. } => {
                let [dx, dy] = of_prism(*tangential, *prism, [x, y]);
                [at[0] + dx, at[1] + dy]
            }
            _ => at,
        }
    }

    /// The tangent of the angle to the axis up to which the image radius grows with the angle.
    fn reach(&self) -> f64 {
        const STEPS: i32 = 4096;
        // The last step would be at 90 degrees.
        let tangents = (1..STEPS).map(|i| {
            let angle = f64::from(i) / f64::from(STEPS) * std::f64::consts::FRAC_PI_2;
            (angle, libm::tan(angle))
        });
        let mut before = 0.0;
        let mut rises = |tangent: f64| {
            let radius = self.radius(tangent);
            let rises = radius > before;
            before = radius;
            rises.then_some(radius)
        };
        let grows = |(angle, tangent): &(f64, f64)| match self {
            Self::RadialTangential(model) => model.grows(tangent * tangent),
            Self::Equidistant(k) | Self::ThinPrismFisheye { k, .. } => wide::equidistant(*k, *angle)[1] > 0.0,
            Self::Unified { then, .. } => rises(*tangent).is_some_and(|radius| then.grows(radius * radius)),
            _ => rises(*tangent).is_some(),
        };
        tangents.take_while(grows).last().map_or(0.0, |(_, tangent)| tangent)
    }
}

/// The decentring and thin prism terms of a fisheye, for a point of the plane z = 1.
fn of_prism(tangential: [f64; 2], prism: [f64; 2], at: [f64; 2]) -> [f64; 2] {
    let tangent = (at[0] * at[0] + at[1] * at[1]).sqrt();
    // The point of an ideal fisheye, whose radius is the angle.
    let factor = if tangent == 0.0 { 1.0 } else { libm::atan(tangent) / tangent };
    RadialTangential::thin_prism(tangential, prism).added(at.map(|v| v * factor), 0.0)
}

impl Lens {
    /// A lens with these focal lengths and principal point, in pixels, and this distortion.
    ///
    /// # Errors
    /// [`Error::Calibration`] when a number is not finite or a focal length not above 0.
    pub fn new(focal_length: [f64; 2], principal_point: [f64; 2], distortion: Distortion) -> Result<Self> {
        let coefficients = distortion.numbers();
        let numbers = focal_length.iter().chain(&principal_point).chain(&coefficients);
        if !numbers.into_iter().all(|v| v.is_finite()) || focal_length.iter().any(|&f| f <= 0.0) {
            return Err(Error::Calibration(format!(
                "has a lens of focal lengths {focal_length:?} and distortion {coefficients:?}, which no camera has"
            )));
        }
        Ok(Self { focal_length, principal_point, distortion, reach: distortion.reach() })
    }

    /// The lens for scaled or cropped images.
    pub(crate) fn in_size(&self, fit: &Fit) -> Self {
        let Camera { focal_length, principal_point } =
            Camera { focal_length: self.focal_length, principal_point: self.principal_point }.in_size(fit);
        Self { focal_length, principal_point, ..*self }
    }

    /// Horizontal and vertical focal length, in pixels.
    #[must_use]
    pub fn focal_length(&self) -> [f64; 2] {
        self.focal_length
    }

    /// Where the optical axis meets the image, in pixels.
    #[must_use]
    pub fn principal_point(&self) -> [f64; 2] {
        self.principal_point
    }

    /// The distortion of the lens.
    #[must_use]
    pub fn distortion(&self) -> Distortion {
        self.distortion
    }

    /// The pixel of the ray (x, y, z), z forward. `None` for a ray from behind, and for one outside the valid
    /// field.
    #[must_use]
    pub fn project(&self, [x, y, z]: [f64; 3]) -> Option<[f64; 2]> {
        let (x, y) = (x / z, y / z);
        let inside = z > 0.0 && x * x + y * y <= self.reach * self.reach;
        inside
            .then(|| self.pixel(self.distortion.distorted([x, y])))
            .filter(|at| at.iter().all(|v| v.is_finite()))
    }

    fn pixel(&self, at: [f64; 2]) -> [f64; 2] {
        std::array::from_fn(|i| self.focal_length[i] * at[i] + self.principal_point[i])
    }

    /// Approximates the point of a pixel in the plane z = 1, as precisely as OpenCV's `undistortPoints` in its
    /// default number of steps. Rectified views are framed by such points, so their frame is the same as OpenCV's.
    pub(crate) fn nearly_undistorted(&self, pixel: [f64; 2]) -> [f64; 2] {
        let start: [f64; 2] =
            std::array::from_fn(|i| (pixel[i] - self.principal_point[i]) / self.focal_length[i]);
        match self.distortion {
            Distortion::RadialTangential(model) => model.nearly_undistorted(start, 5),
            Distortion::Equidistant(k) => {
                let radius = (start[0] * start[0] + start[1] * start[1]).sqrt();
                let radius = radius.min(std::f64::consts::FRAC_PI_2);
                if radius <= 1e-8 {
                    return start;
                }
                let mut angle = radius;
                for _ in 0..10 {
                    let [found, slope] = wide::equidistant(k, angle);
                    angle -= (found - radius) / slope;
                }
                start.map(|v| v * libm::tan(angle) / radius)
            }
            Distortion::Unified { then, .. } => self.at_radius(then.nearly_undistorted(start, 20)),
            Distortion::ThinPrismFisheye { tangential, prism, .. } => {
                (0..20).fold(self.at_radius(start), |found, _| {
                    let [dx, dy] = of_prism(tangential, prism, found);
                    self.at_radius([start[0] - dx, start[1] - dy])
                })
            }
            _ => self.at_radius(start),
        }
    }

    /// The point of the plane z = 1 with the image `at` in a radial model, or one at the edge of the field.
    fn at_radius(&self, at: [f64; 2]) -> [f64; 2] {
        let radius = (at[0] * at[0] + at[1] * at[1]).sqrt();
        if radius <= 1e-12 {
            return at;
        }
        // Bisection, since the radius grows with the tangent.
        let (mut low, mut high) = (0.0, self.reach);
        for _ in 0..64 {
            let middle = f64::midpoint(low, high);
            if self.distortion.radius(middle) < radius {
                low = middle;
            } else {
                high = middle;
            }
        }
        at.map(|v| v * low / radius)
    }

    /// Whether the image radius is not close to the tangent of the angle: fisheyes and other wide lenses.
    pub(crate) fn is_wide(&self) -> bool {
        !matches!(self.distortion, Distortion::RadialTangential(_))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn radial(coefficients: &[f64]) -> Distortion {
        Distortion::RadialTangential(RadialTangential::new(coefficients).unwrap())
    }

    fn lens(distortion: Distortion) -> Lens {
        Lens::new([500.0, 510.0], [320.0, 240.0], distortion).unwrap()
    }

    fn thin_prism_fisheye() -> Distortion {
        let (tangential, prism) = ([0.001, -0.002], [0.003, -0.001]);
        Distortion::ThinPrismFisheye { k: [0.02, -0.01, 0.003, 0.001], tangential, prism }
    }

    #[test]
    fn coefficients_survive_a_round_trip() {
        let all: Vec<f64> = (1..=14).map(|i| f64::from(i) / 100.0).collect();
        for (given, kept) in [(0, 5), (4, 5), (5, 5), (8, 8), (12, 12), (14, 14)] {
            let found = RadialTangential::new(&all[..given]).unwrap().coefficients();
            assert_eq!(found.len(), kept);
            // The angles of the tilt are recovered from its matrix.
            let all = all[..given].iter().chain(&[0.0; 5]);
            assert!(found.iter().zip(all).all(|(found, c)| (found - c).abs() < 1e-15), "{found:?}");
        }
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
    fn distortion_follows_the_formulas() {
        // r2 = 0.25 + 0.0625; computed by hand from the formulas of OpenCV's manual.
        let seen = lens(radial(&[-0.2, 0.04, 0.001, 0.002, -0.01]));
        let (x, y, r2) = (0.5, -0.25, 0.3125_f64);
        let factor = 1.0 - 0.2 * r2 + 0.04 * r2 * r2 - 0.01 * r2 * r2 * r2;
        let expected = [
            500.0 * (x * factor + 2.0 * 0.001 * x * y + 0.002 * (r2 + 2.0 * x * x)) + 320.0,
            510.0 * (y * factor + 0.001 * (r2 + 2.0 * y * y) + 2.0 * 0.002 * x * y) + 240.0,
        ];
        let found = seen.project([x, y, 1.0]).unwrap();
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-10), "{found:?} {expected:?}");
        // A fisheye without coefficients: the radius is the angle.
        let found = lens(Distortion::Equidistant([0.0; 4])).project([1.0, 0.0, 1.0]).unwrap();
        assert!((found[0] - 320.0 - 500.0 * std::f64::consts::FRAC_PI_4).abs() < 1e-10, "{found:?}");
    }

    #[test]
    fn undistortion_undoes_weak_distortion() {
        for distortion in [
            radial(&[-0.05, 0.01, 0.001, -0.001, 0.0, 0.01, 0.0, 0.0]),
            Distortion::Equidistant([0.02, -0.01, 0.003, 0.0]),
            Distortion::Unified {
                xi: 0.9,
                then: RadialTangential::new(&[-0.05, 0.01, 0.001, -0.001]).unwrap(),
            },
            Distortion::DoubleSphere { xi: -0.2, alpha: 0.6 },
            Distortion::ExtendedUnified { alpha: 0.6, beta: 1.1 },
            Distortion::FieldOfView(0.9),
            thin_prism_fisheye(),
            radial(&[-0.05, 0.01, 0.001, -0.001, 0.0, 0.01, 0.0, 0.0, 0.001, 0.0, -0.002, 0.0, 0.02, -0.03]),
        ] {
            let lens = lens(distortion);
            let pixel = lens.project([0.3, -0.2, 1.0]).unwrap();
            let [x, y] = lens.nearly_undistorted(pixel);
            assert!((x - 0.3).abs() < 1e-5 && (y + 0.2).abs() < 1e-5, "{distortion:?}: {x} {y}");
        }
    }

    /// Computed by hand from the definitions in the papers; `scripts/rectify` checks many more points.
    #[test]
    fn wide_lenses_follow_their_formulas() {
        let ray = [0.6_f64, 0.0, 0.8];
        // The ray has length 1 and the tangent 0.75.
        let unified = Distortion::Unified { xi: 0.5, then: RadialTangential::NONE };
        let spheres = Distortion::DoubleSphere { xi: -0.25, alpha: 0.5 };
        let ellipsoid = Distortion::ExtendedUnified { alpha: 0.5, beta: 2.0 };
        let second = (0.36 + 0.55 * 0.55_f64).sqrt();
        for (distortion, radius) in [
            (unified, 0.6 / (0.8 + 0.5)),
            (spheres, 0.6 / (0.5 * second + 0.5 * 0.55)),
            (ellipsoid, 0.6 / (0.5 * (2.0 * 0.36 + 0.64_f64).sqrt() + 0.5 * 0.8)),
            (Distortion::FieldOfView(1.0), (1.5 * 0.5_f64.tan()).atan()),
        ] {
            let found = lens(distortion).project(ray).unwrap();
            assert!((found[0] - 320.0 - 500.0 * radius).abs() < 1e-9, "{distortion:?}: {found:?}");
            assert!((found[1] - 240.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_thin_prism_is_added_to_a_fisheye() {
        let (tangent, seen) = (0.625_f64, lens(thin_prism_fisheye()).project([0.6, 0.8, 1.6]).unwrap());
        // u and v of the definition: the angle in the direction (0.6, 0.8).
        let angle = tangent.atan();
        let (u, v, r2) = (0.6 * angle, 0.8 * angle, angle * angle);
        let radial = 0.02 * r2 - 0.01 * r2.powi(2) + 0.003 * r2.powi(3) + 0.001 * r2.powi(4);
        let x = u * (1.0 + radial) + 2.0 * 0.001 * u * v - 0.002 * (r2 + 2.0 * u * u) + 0.003 * r2;
        let y = v * (1.0 + radial) - 2.0 * 0.002 * u * v + 0.001 * (r2 + 2.0 * v * v) - 0.001 * r2;
        let expected = [500.0 * x + 320.0, 510.0 * y + 240.0];
        assert!(seen.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{seen:?} {expected:?}");
    }

    #[test]
    fn rays_beyond_the_growing_radius_have_no_image() {
        // r (1 - 0.5 r2) grows up to r = 0.816.
        let lens = lens(radial(&[-0.5, 0.0, 0.0, 0.0]));
        assert!(lens.project([0.81, 0.0, 1.0]).is_some() && lens.project([0.82, 0.0, 1.0]).is_none());
    }

    #[test]
    fn unknown_numbers_of_coefficients_are_refused() {
        for count in [1, 2, 3, 6, 7, 9, 13, 15] {
            assert!(RadialTangential::new(&vec![0.0; count]).is_err(), "{count}");
        }
        assert_eq!(radial(&[0.0; 14]), Distortion::NONE);
        let mut upright = [0.0; 14];
        upright[12] = 1.6;
        assert!(RadialTangential::new(&upright).unwrap_err().contains("tilt"));
        assert!(Lens::new([0.0, 1.0], [0.0; 2], Distortion::NONE).is_err());
        assert!(Lens::new([1.0, f64::NAN], [0.0; 2], Distortion::NONE).is_err());
    }
}
