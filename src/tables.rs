//! Exponentials, logarithms and integer tables of them: the transcendental functions of the method, the same on
//! every machine because they are evaluated with IEEE additions, multiplications and divisions alone.

use std::f64::consts::{LN_2, SQRT_2};

use crate::options::Method;

/// exp(-x) for x >= 0, by a Taylor series of exp(x / 2^k) and k squarings; to a relative 1e-11.
#[must_use]
pub fn exp_neg(x: f64) -> f64 {
    if x > 700.0 {
        return 0.0;
    }
    let mut reduced = x;
    let mut squarings = 0;
    while reduced > 0.125 {
        reduced /= 2.0;
        squarings += 1;
    }
    let (mut term, mut sum) = (1.0, 1.0);
    for n in 1..=12 {
        term *= reduced / f64::from(n);
        sum += term;
    }
    for _ in 0..squarings {
        sum *= sum;
    }
    1.0 / sum
}

/// The natural logarithm of a positive, normal x, to a relative 1e-11: x = m 2^e with m from 1/sqrt 2 to sqrt 2, and
/// ln m = 2 artanh((m - 1) / (m + 1)) by its series.
#[must_use]
pub fn ln(x: f64) -> f64 {
    const MANTISSA_BITS: u32 = 52;
    const MANTISSA: u64 = (1 << MANTISSA_BITS) - 1;
    let mut exponent = (x.to_bits() >> MANTISSA_BITS) as i32 - 1023;
    let mut m = f64::from_bits(x.to_bits() & MANTISSA | 1.0f64.to_bits());
    if m > SQRT_2 {
        m /= 2.0;
        exponent += 1;
    }
    let s = (m - 1.0) / (m + 1.0);
    let (mut power, mut sum) = (s, 0.0);
    for n in 0..8 {
        sum += power / f64::from(2 * n + 1);
        power *= s * s;
    }
    f64::from(exponent) * LN_2 + 2.0 * sum
}

/// How far apart the places of the stretched window are, as a power of two.
const STRETCH_BITS: u32 = 2;
/// Entries of the range table; differences beyond it weigh nothing.
const MEDIAN_RANGE_ENTRIES: usize = 1024;
/// Bits of each of the two weights that are multiplied.
const MEDIAN_WEIGHT_BITS: u32 = 10;

/// Integer weights of the bilateral window: the product of a spatial weight and a range weight, each round(1024
/// exp(-e)), shifted right by 10. For the range weight, the squared colour difference in sixteenths of an 8-bit level
/// is rounded down to whole steps of 2^k, the smallest (up to 2^26) of which 1024 exceed 16 variances; a difference of
/// 1024 steps or more weighs nothing.
#[derive(Clone, Debug)]
pub struct MedianWeights {
    radius: usize,
    step_bits: u32,
    /// By |dy| and dx from -radius to radius, in places, \[dy\]\[dx\].
    space: Vec<u32>,
    /// By squared colour difference, in steps of 2^shift, and 0 for all beyond.
    range: Vec<u32>,
    shift: u32,
}

impl MedianWeights {
    /// The weights that `method` asks for.
    #[must_use]
    pub fn of(method: &Method) -> Self {
        let window = method.median_window as usize;
        Self::new(window, method.median_sigma_space, method.median_sigma_range)
    }

    /// Those of the stretched window: its places four pixels apart, each with its spatial weight, and half the range
    /// sigma.
    #[must_use]
    pub fn stretched(method: &Method) -> Self {
        let window = method.median_window as usize;
        let weights = Self::new(window, method.median_sigma_space, method.median_sigma_range / 2.0);
        Self { step_bits: STRETCH_BITS, ..weights }
    }

    /// Weights for a window of `window` pixels, sigmas in pixels and in the intensity range 0 to 1.
    #[must_use]
    pub fn new(window: usize, sigma_space: f64, sigma_range: f64) -> Self {
        let radius = window / 2;
        let weight = |e: f64| (f64::from(1 << MEDIAN_WEIGHT_BITS) * exp_neg(e) + 0.5).floor() as u32;
        let space = (0..=radius)
            .flat_map(|dy| (0..=2 * radius).map(move |x| (x.abs_diff(radius).pow(2) + dy * dy) as f64))
            .map(|d| weight(d / (2.0 * sigma_space * sigma_space)))
            .collect();
        // In squared sixteenths of an 8-bit level; exp(-8) is below half a unit of weight.
        let twice_variance = 2.0 * (sigma_range * 4080.0) * (sigma_range * 4080.0);
        let mut shift = 0;
        while f64::from(1u32 << shift) * MEDIAN_RANGE_ENTRIES as f64 <= 8.0 * twice_variance && shift < 26 {
            shift += 1;
        }
        let range = (0..MEDIAN_RANGE_ENTRIES)
            .map(|i| weight(i as f64 * f64::from(1u32 << shift) / twice_variance))
            .chain([0])
            .collect();
        Self { radius, step_bits: 0, space, range, shift }
    }

    /// Radius of the window in places.
    #[must_use]
    pub fn radius(&self) -> usize {
        self.radius
    }

    /// How far apart its places are: 2 to this many pixels.
    #[must_use]
    pub fn step_bits(&self) -> u32 {
        self.step_bits
    }

    /// Bits by which a squared colour difference is shifted right to find its weight.
    #[must_use]
    pub fn shift(&self) -> u32 {
        self.shift
    }

    /// Spatial weights by |dy| and |dx|, then range weights, as the shader takes them.
    #[must_use]
    pub fn words(&self) -> Vec<u32> {
        let rows = self.space.chunks_exact(2 * self.radius + 1).flat_map(|row| &row[self.radius..]);
        rows.chain(&self.range[..MEDIAN_RANGE_ENTRIES]).copied().collect()
    }

    /// Spatial weights of the row |dy| places away, for dx from -radius to radius.
    #[must_use]
    pub fn space_row(&self, dy: usize) -> &[u32] {
        let side = 2 * self.radius + 1;
        &self.space[dy * side..][..side]
    }

    /// Weight of a pixel of spatial weight `space` whose squared colour difference is `distance`.
    #[must_use]
    pub fn product(&self, space: u32, distance: u32) -> u32 {
        let range = self.range[((distance >> self.shift) as usize).min(MEDIAN_RANGE_ENTRIES)];
        (space * range) >> MEDIAN_WEIGHT_BITS
    }

    /// Weight of a pixel |dx|, |dy| places away whose squared colour difference is `distance`.
    #[must_use]
    pub fn weight(&self, dx: usize, dy: usize, distance: u32) -> u32 {
        self.product(self.space_row(dy)[self.radius + dx], distance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_agree_with_the_platform() {
        for i in 0..7000 {
            let x = f64::from(i) / 10.0;
            let (ours, libm) = (exp_neg(x), (-x).exp());
            assert!((ours - libm).abs() <= 1e-11 * libm, "exp(-{x}): {ours} against {libm}");
        }
        assert!(exp_neg(1e6) < f64::MIN_POSITIVE);
    }

    #[test]
    fn logarithms_agree_with_the_platform() {
        let grid = (1..=65536).map(|i| f64::from(i) / 64.0);
        let edges = [f64::MIN_POSITIVE, f64::MAX, SQRT_2, 0.5 * SQRT_2, 1.0 - 1e-9, 1.0 + 1e-9];
        for x in grid.chain(edges) {
            let (ours, libm) = (ln(x), x.ln());
            assert!((ours - libm).abs() <= 1e-11 * libm.abs(), "ln {x}: {ours} against {libm}");
        }
        assert!(ln(1.0).abs() < f64::MIN_POSITIVE);
    }
}
