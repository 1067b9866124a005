//! OpenCV's distortion model: polynomials of the radius, decentred lenses, thin prisms and a tilted sensor.

use crate::calibration::matrix::{Matrix, product, rotated, transposed};

/// Radial and tangential distortion, with an optional thin prism and tilt of the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadialTangential {
    /// k1 to k6.
    radial: [f64; 6],
    /// p1 and p2.
    tangential: [f64; 2],
    /// s1 to s4.
    prism: [f64; 4],
    /// From the plane of the lens to the tilted sensor, and back.
    tilt: Option<[Matrix; 2]>,
}

impl RadialTangential {
    /// The distortion of a pinhole.
    pub const NONE: Self = Self { radial: [0.0; 6], tangential: [0.0; 2], prism: [0.0; 4], tilt: None };

    /// Takes coefficients in the usual order: k1, k2, p1, p2, k3 to k6, s1 to s4, and the angles of the tilt.
    /// Their number is 0, 4, 5, 8, 12 or 14. The error says what was expected.
    ///
    /// # Errors
    /// For another number of coefficients, and for a sensor perpendicular to its lens.
    pub fn new(coefficients: &[f64]) -> Result<Self, &'static str> {
        if !matches!(coefficients.len(), 0 | 4 | 5 | 8 | 12 | 14) {
            return Err(
                "4, 5, 8, 12 or 14 coefficients: k1, k2, p1, p2, then k3, k4 to k6, s1 to s4, and the tilt",
            );
        }
        let c = |i: usize| coefficients.get(i).copied().unwrap_or(0.0);
        let tilt = [c(12), c(13)];
        let tilt = if tilt.iter().all(|angle| *angle == 0.0) {
            None
        } else {
            Some(tilted(tilt).ok_or("a tilt of less than 90 degrees")?)
        };
        let plain = Self::polynomials(std::array::from_fn(c));
        Ok(Self { prism: [c(8), c(9), c(10), c(11)], tilt, ..plain })
    }

    /// The coefficients in the order of [`new`](Self::new): 5, or more if those are not 0.
    #[must_use]
    pub fn coefficients(&self) -> Vec<f64> {
        let [k1, k2, rest @ ..] = self.radial;
        // The last row of the rotation is also that of the projection to the sensor.
        let tilt = self.tilt.map_or([0.0; 2], |[[_, _, [x, y, z]], _]| [libm::atan2(-y, z), libm::asin(x)]);
        let mut all = [&[k1, k2], &self.tangential[..], &rest, &self.prism, &tilt].concat();
        for (shorter, longer) in [(12, 14), (8, 12), (5, 8)] {
            if all.len() == longer && all[shorter..].iter().all(|c| *c == 0.0) {
                all.truncate(shorter);
            }
        }
        all
    }

    /// The model of k1, k2, p1, p2, k3 to k6.
    pub(crate) fn polynomials([k1, k2, p1, p2, k3, k4, k5, k6]: [f64; 8]) -> Self {
        Self { radial: [k1, k2, k3, k4, k5, k6], tangential: [p1, p2], ..Self::NONE }
    }

    /// The model of p1, p2 and a thin prism with the quadratic shifts `s1` and `s3`.
    pub(super) fn thin_prism(tangential: [f64; 2], [across, down]: [f64; 2]) -> Self {
        Self { tangential, prism: [across, 0.0, down, 0.0], ..Self::NONE }
    }

    pub(super) fn numbers(&self) -> Vec<f64> {
        let tilt = self.tilt.iter().flatten().flatten().flatten();
        [&self.radial[..], &self.tangential, &self.prism].concat().into_iter().chain(tilt.copied()).collect()
    }

    /// `factor` times (x, y), plus the tangential part and the prism.
    pub(super) fn added(&self, [x, y]: [f64; 2], factor: f64) -> [f64; 2] {
        let ([p1, p2], [s1, s2, s3, s4]) = (self.tangential, self.prism);
        let r2 = x * x + y * y;
        [
            x * factor + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + (s1 + s2 * r2) * r2,
            y * factor + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y + (s3 + s4 * r2) * r2,
        ]
    }

    /// The image of a point of the plane z = 1.
    pub(super) fn distorted(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [above, below] = self.factor(x * x + y * y);
        let at = self.added([x, y], above / below);
        self.tilt.map_or(at, |[there, _]| through(&there, at))
    }

    /// Approximates the inverse by the given number of OpenCV's iterations.
    pub(super) fn nearly_undistorted(&self, start: [f64; 2], steps: usize) -> [f64; 2] {
        let flat = self.tilt.map_or(start, |[_, back]| through(&back, start));
        let [mut x, mut y] = flat;
        for _ in 0..steps {
            let r2 = x * x + y * y;
            let [above, below] = self.factor(r2);
            let factor = below / above;
            if factor < 0.0 {
                return start;
            }
            let [dx, dy] = self.added([x, y], 0.0);
            (x, y) = ((flat[0] - dx) * factor, (flat[1] - dy) * factor);
        }
        [x, y]
    }

    /// The numerator and denominator of the radial factor at the square `r2` of the radius.
    fn factor(&self, r2: f64) -> [f64; 2] {
        let [k1, k2, k3, k4, k5, k6] = self.radial;
        [1.0 + ((k3 * r2 + k2) * r2 + k1) * r2, 1.0 + ((k6 * r2 + k5) * r2 + k4) * r2]
    }

    /// Whether the image radius grows with the radius in the plane, whose square is `r2`.
    pub(super) fn grows(&self, r2: f64) -> bool {
        let k = self.radial;
        let [above, below] = self.factor(r2);
        let slope = |[a, b, c]: [f64; 3]| a + r2 * (2.0 * b + r2 * 3.0 * c);
        let slopes = [slope([k[0], k[1], k[2]]), slope([k[3], k[4], k[5]])];
        below > 0.0 && above > 0.0 && above * below + 2.0 * r2 * (slopes[0] * below - above * slopes[1]) > 0.0
    }
}

/// The point of the plane z = 1 on the ray of such a point after `turn`.
fn through(turn: &Matrix, [x, y]: [f64; 2]) -> [f64; 2] {
    let [x, y, z] = rotated(turn, [x, y, 1.0]);
    [x / z, y / z]
}

/// From the plane of a lens to a sensor that is rotated by these angles about x and then y, and back. `None` at 90 degrees or more.
fn tilted([about_x, about_y]: [f64; 2]) -> Option<[Matrix; 2]> {
    let ([sx, cx], [sy, cy]) =
        ([libm::sin(about_x), libm::cos(about_x)], [libm::sin(about_y), libm::cos(about_y)]);
    let turn = product(
        &[[cy, 0.0, -sy], [0.0, 1.0, 0.0], [sy, 0.0, cy]],
        &[[1.0, 0.0, 0.0], [0.0, cx, sx], [0.0, -sx, cx]],
    );
    let [x, y, z] = [turn[0][2], turn[1][2], turn[2][2]];
    let there = [[z, 0.0, -x], [0.0, z, -y], [0.0, 0.0, 1.0]];
    let back = [[1.0 / z, 0.0, x / z], [0.0, 1.0 / z, y / z], [0.0, 0.0, 1.0]];
    (z > 1e-3).then(|| [product(&there, &turn), product(&transposed(&turn), &back)])
}
