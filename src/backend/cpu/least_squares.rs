//! Least-squares planes through the disparities of windows: see [`crate::backend::Stage::Plane`].
//!
//! The lanes of vectors are neighbouring pixels of a row, as in the median, which loads the values. Sums
//! along a row or column of the window fit in 16 bits.

use super::places::{LANES, Values, Weighed};
use super::units::each_lane;
use crate::plan::planes::{PLANE_BITS, PLANE_FARTHEST, PLANE_STEEPEST};

/// Largest side of a window.
const MOST: usize = 31;

/// One number per lane.
type Lanes<T> = [T; LANES];

/// Planes through the disparities around [`LANES`] adjacent pixels, and their sums. (The struct stays in
/// memory, because from there compilers vectorize what they would otherwise spread over scalar registers.)
#[derive(Default)]
pub(super) struct Planes {
    /// Values of the planes at the pixels, relative to the medians.
    value: Lanes<i32>,
    /// Slopes along x and y.
    slopes: [Lanes<i32>; 2],
    rows: [Line; MOST],
    columns: [Line; MOST],
    sums: Sums,
}

/// Sums over a row or a column of the windows. All fit in 16 bits: m is at most 127 and |g| at most 1016.
#[derive(Clone, Copy, Default)]
struct Line {
    m: Lanes<i16>,
    /// Sum of m x; only for rows.
    mx: Lanes<i16>,
    g: Lanes<i16>,
}

/// The sums over the windows.
#[derive(Default)]
struct Sums {
    m: Lanes<i32>,
    mx: Lanes<i32>,
    my: Lanes<i32>,
    mxx: Lanes<i32>,
    myy: Lanes<i32>,
    mxy: Lanes<i32>,
    g: Lanes<i32>,
    gx: Lanes<i32>,
    gy: Lanes<i32>,
}

impl Planes {
    /// The values of the planes relative to the medians, for windows of this radius.
    #[inline(always)]
    pub(super) fn above_medians(
        &mut self,
        radius: usize,
        weighed: &[Weighed],
        values: &[Values],
        medians: &Lanes<i16>,
    ) -> &Lanes<i32> {
        (self.value, self.slopes) = Default::default();
        for bits in PLANE_BITS {
            self.sum_lines(radius, weighed, values, medians, bits);
            self.sum_all(radius);
            self.follow(bits);
        }
        &self.value
    }

    /// Sums over rows and columns; disparities count up to 2^(8 + `bits`) / 256 px from the plane.
    #[inline(always)]
    fn sum_lines(
        &mut self,
        radius: usize,
        weighed: &[Weighed],
        values: &[Values],
        medians: &Lanes<i16>,
        bits: u32,
    ) {
        let Self { value: above, slopes, rows, columns, .. } = self;
        let (rows, columns) = (&mut rows[..=2 * radius], &mut columns[..=2 * radius]);
        rows.fill(Line::default());
        columns.fill(Line::default());
        let base: Lanes<i16> = each_lane(|i| medians[i] + above[i] as i16);
        let slope_x: Lanes<i16> = each_lane(|i| slopes[0][i] as i16);
        let slope_y: Lanes<i16> = each_lane(|i| slopes[1][i] as i16);
        for (Values(values), &Weighed { step: [x, y], ref weights, .. }) in values.iter().zip(weighed) {
            let plane: Lanes<i16> = each_lane(|i| base[i] + x * slope_x[i] + y * slope_y[i]);
            let e: Lanes<i16> = each_lane(|i| values[i].saturating_sub(plane[i]) >> bits);
            let near: Lanes<u16> = each_lane(|i| 256u16.saturating_sub(e[i].unsigned_abs()));
            let m: Lanes<i16> = each_lane(|i| ((u16::from(weights[i]) * near[i]) >> 8) as i16);
            let g: Lanes<i16> = each_lane(|i| (m[i] * e[i]) >> 3);
            let row = &mut rows[(y + radius as i16) as usize];
            row.m = each_lane(|i| row.m[i] + m[i]);
            row.mx = each_lane(|i| row.mx[i] + m[i] * x);
            row.g = each_lane(|i| row.g[i] + g[i]);
            let column = &mut columns[(x + radius as i16) as usize];
            column.m = each_lane(|i| column.m[i] + m[i]);
            column.g = each_lane(|i| column.g[i] + g[i]);
        }
    }

    /// Sums over the windows.
    #[inline(always)]
    fn sum_all(&mut self, radius: usize) {
        let Self { rows, columns, sums, .. } = self;
        *sums = Sums::default();
        // Every second row has places, including the one of the centre.
        let skipped = radius % 2;
        let from = radius as i16;
        for (row, y) in rows[skipped..=2 * radius].iter().step_by(2).zip((skipped as i16 - from..).step_by(2))
        {
            let (y, yy) = (i32::from(y), i32::from(y * y));
            sums.m = each_lane(|i| sums.m[i] + i32::from(row.m[i]));
            sums.mx = each_lane(|i| sums.mx[i] + i32::from(row.mx[i]));
            sums.my = each_lane(|i| sums.my[i] + y * i32::from(row.m[i]));
            sums.myy = each_lane(|i| sums.myy[i] + yy * i32::from(row.m[i]));
            sums.mxy = each_lane(|i| sums.mxy[i] + y * i32::from(row.mx[i]));
            sums.g = each_lane(|i| sums.g[i] + i32::from(row.g[i]));
            sums.gy = each_lane(|i| sums.gy[i] + y * i32::from(row.g[i]));
        }
        for (column, x) in columns[..=2 * radius].iter().zip(-from..) {
            let (x, xx) = (i32::from(x), i32::from(x * x));
            sums.mxx = each_lane(|i| sums.mxx[i] + xx * i32::from(column.m[i]));
            sums.gx = each_lane(|i| sums.gx[i] + x * i32::from(column.g[i]));
        }
    }

    /// Updates the planes by least squares from the sums, in units of 2^`bits`. All numbers fit in 32 bits:
    /// in windows of up to 31 x 31, xx and yy are at most 3,650, and |xe| and |ye| at most 3,845.
    #[inline(always)]
    fn follow(&mut self, bits: u32) {
        let Self { value, slopes: [slope_x, slope_y], sums, .. } = self;
        for i in 0..LANES {
            let all = Divisor::new(sums.m[i].max(1));
            let u = all.divide(16 * sums.mx[i]);
            let v = all.divide(16 * sums.my[i]);
            let t = all.divide(32 * sums.g[i]);
            let xx = all.divide(16 * (sums.mxx[i] - ((sums.mx[i] * u) >> 4))) + 16;
            let yy = all.divide(16 * (sums.myy[i] - ((sums.my[i] * v) >> 4))) + 16;
            let xy = all.divide(16 * (sums.mxy[i] - ((sums.mx[i] * v) >> 4)));
            let xe = all.divide(8 * sums.gx[i] - ((sums.mx[i] * t) >> 2));
            let ye = all.divide(8 * sums.gy[i] - ((sums.my[i] * t) >> 2));
            let n = Divisor::new((xx * yy - xy * xy).max(1));
            let to = |slope: i32, part: i32| {
                (slope + n.divide(part << (bits + 4))).clamp(-PLANE_STEEPEST, PLANE_STEEPEST)
            };
            let a = to(slope_x[i], xe * yy - ye * xy);
            let b = to(slope_y[i], ye * xx - xe * xy);
            let (da, db) = (a - slope_x[i], b - slope_y[i]);
            (slope_x[i], slope_y[i]) = (a, b);
            let higher = ((t << (bits + 2)) - da * u - db * v + 8) >> 4;
            value[i] = (value[i] + higher).clamp(-PLANE_FARTHEST, PLANE_FARTHEST);
        }
    }
}

/// A positive divisor as a float, since vectors have no integer division.
#[derive(Clone, Copy)]
pub(super) struct Divisor(f64);

impl Divisor {
    #[inline(always)]
    pub(super) fn new(divisor: i32) -> Self {
        // So far above 1 that no exact quotient is rounded below itself, and so near that no other becomes exact.
        const ONE: f64 = 1.0 + 4.0 * f64::EPSILON;
        Self(ONE / f64::from(divisor))
    }

    /// The quotient, rounded towards 0.
    #[inline(always)]
    pub(super) fn divide(self, number: i32) -> i32 {
        // Adding this puts an integer into the lower bits of the sum.
        const WHOLE: f64 = 1.5 * (1u64 << 52) as f64;
        ((f64::from(number) * self.0).trunc() + WHOLE).to_bits() as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotients_equal_integer_division() {
        let few =
            [1, 2, 3, 5, 7, 10, 127, 641, 59_055, 65_536, 6_700_417, 13_322_500, i32::MAX - 1, i32::MAX];
        let many = (1..3000).map(|i| 1 + i * i * 37).chain(few);
        for divisor in many {
            let by = Divisor::new(divisor);
            for quotient in few.iter().flat_map(|&n| [n, i32::MAX / divisor, n % (i32::MAX / divisor).max(1)])
            {
                let Some(product) = quotient.checked_mul(divisor) else { continue };
                for number in [product - 1, product, product.saturating_add(1)] {
                    assert_eq!(by.divide(number), number / divisor, "{number} / {divisor}");
                    assert_eq!(by.divide(-number), -number / divisor, "-{number} / {divisor}");
                }
            }
        }
    }
}
