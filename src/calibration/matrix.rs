//! Rotation matrices, with the same bits on every platform.

/// A matrix of three rows.
pub type Matrix = [[f64; 3]; 3];

/// The identity.
pub const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// `a` times `b`.
#[must_use]
pub fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let column = |x: usize| rotated(a, [b[0][x], b[1][x], b[2][x]]);
    transposed(&[column(0), column(1), column(2)])
}

/// `matrix` times the column `v`.
#[must_use]
pub fn rotated(matrix: &Matrix, v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| dot(row, v))
}

/// The transpose, which is the inverse of a rotation.
#[must_use]
pub fn transposed(m: &Matrix) -> Matrix {
    std::array::from_fn(|y| std::array::from_fn(|x| m[x][y]))
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn length(v: [f64; 3]) -> f64 {
    dot(v, v).sqrt()
}

pub(crate) fn scaled(v: [f64; 3], by: f64) -> [f64; 3] {
    v.map(|x| x * by)
}

/// The rotation about the axis `v` by the length of `v` in radians (Rodrigues).
#[must_use]
pub fn rotation(v: [f64; 3]) -> Matrix {
    let angle = length(v);
    if angle == 0.0 {
        return IDENTITY;
    }
    let axis = scaled(v, 1.0 / angle);
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let [x, y, z] = axis;
    let turn = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    std::array::from_fn(|r| {
        std::array::from_fn(|c| cos * IDENTITY[r][c] + (1.0 - cos) * axis[r] * axis[c] + sin * turn[r][c])
    })
}

/// The rotation of a quaternion, w first. `None` if its length is not 1 up to rounding.
pub(crate) fn of_quaternion([w, x, y, z]: [f64; 4]) -> Option<Matrix> {
    let square = w * w + x * x + y * y + z * z;
    let s = 2.0 / square;
    ((square - 1.0).abs() < 1e-2).then_some([
        [1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
        [s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)],
        [s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)],
    ])
}

/// The inverse of [`rotation`] for less than half a turn: the axis, with the angle in radians as length.
#[must_use]
pub fn rotation_vector(m: &Matrix) -> [f64; 3] {
    // The axis, scaled to twice the sine of the angle.
    let v = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]];
    let sin = length(v) / 2.0;
    if sin == 0.0 {
        return [0.0; 3];
    }
    let cos = (m[0][0] + m[1][1] + m[2][2] - 1.0) / 2.0;
    scaled(v, libm::atan2(sin, cos) / (2.0 * sin))
}

/// The angle of a rotation, in degrees.
pub(crate) fn degrees(m: &Matrix) -> f64 {
    let v = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]];
    libm::atan2(length(v), m[0][0] + m[1][1] + m[2][2] - 1.0).to_degrees()
}

/// The angle between two directions, in degrees.
pub(crate) fn degrees_between(a: [f64; 3], b: [f64; 3]) -> f64 {
    libm::atan2(length(cross(a, b)), dot(a, b)).to_degrees()
}

/// The rotation nearest to `m`; `None` if `m` is not a rotation up to rounding.
pub(crate) fn nearest_rotation(m: &Matrix) -> Option<Matrix> {
    const DIGITS: f64 = 1e-2;
    // Newton's iteration for the orthogonal factor, which converges quadratically from a start so close.
    let mut near = *m;
    for _ in 0..8 {
        let [a, b, c] = near;
        let determinant = dot(a, cross(b, c));
        if determinant <= 0.5 {
            return None;
        }
        let inverse = [cross(b, c), cross(c, a), cross(a, b)].map(|row| scaled(row, 1.0 / determinant));
        near = std::array::from_fn(|y| std::array::from_fn(|x| f64::midpoint(near[y][x], inverse[y][x])));
    }
    let close = m.iter().flatten().zip(near.iter().flatten()).all(|(a, b)| (a - b).abs() <= DIGITS);
    close.then_some(near)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: &Matrix, b: &Matrix) -> bool {
        a.iter().flatten().zip(b.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-14)
    }

    #[test]
    fn rotation_vectors_survive_a_round_trip() {
        for v in [[0.0; 3], [0.1, -0.2, 0.3], [1e-9, 0.0, 0.0], [0.0, 2.9, 0.0]] {
            let matrix = rotation(v);
            assert!(close(&product(&matrix, &transposed(&matrix)), &IDENTITY), "{v:?}");
            let back = rotation_vector(&matrix);
            assert!(v.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-14), "{v:?}: {back:?}");
        }
        // A quarter turn about z takes x to y.
        let turned = rotated(&rotation([0.0, 0.0, std::f64::consts::FRAC_PI_2]), [1.0, 0.0, 0.0]);
        assert!((turned[1] - 1.0).abs() < 1e-15 && turned[0].abs() < 1e-15, "{turned:?}");
    }

    #[test]
    fn a_quaternion_gives_its_rotation() {
        let (half, axis) = (0.35_f64, [0.36, -0.48, 0.8]);
        let q = [half.cos(), half.sin() * axis[0], half.sin() * axis[1], half.sin() * axis[2]];
        assert!(close(&of_quaternion(q).unwrap(), &rotation(scaled(axis, 0.7))));
        assert_eq!(of_quaternion([0.0, 0.5, 0.5, 0.5]), None);
    }

    #[test]
    fn angles_are_in_degrees() {
        for angle in [0.0, 0.001, 90.0, 179.0_f64] {
            let found = degrees(&rotation(scaled([0.6, 0.0, 0.8], angle.to_radians())));
            assert!((found - angle).abs() < 1e-9, "{angle}: {found}");
        }
        assert!((degrees_between([1.0, 0.0, 0.0], [-2.0, 2.0, 0.0]) - 135.0).abs() < 1e-12);
    }

    #[test]
    fn rounded_rotations_are_restored() {
        let exact = rotation([0.02, -0.1, 0.05]);
        let rounded = exact.map(|row| row.map(|v| (v * 1e4).round() / 1e4));
        let near = nearest_rotation(&rounded).unwrap();
        assert!(close(&product(&near, &transposed(&near)), &IDENTITY));
        assert!(near.iter().flatten().zip(exact.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-4));
        let mirror = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for wrong in [mirror, [[0.0; 3]; 3], [[1.0; 3]; 3], IDENTITY.map(|row| row.map(|v| 1.1 * v))] {
            assert_eq!(nearest_rotation(&wrong), None, "{wrong:?}");
        }
    }
}
