//! Numbers side by side, so that one transform processes several rows or columns with vector instructions.
//!
//! Each lane goes through the operations of a single transform, in the same order, and ends with the same bits.

use std::array::from_fn;
use std::ops::{Add, Div, Mul, Neg, Rem, Sub};

use rustfft::num_complex::Complex;
use rustfft::num_traits::{FromPrimitive, Num, One, Signed, Zero};

/// Number of lanes: the width of the vectors that every processor has. One in a browser, where transforms with more of them would make up a
/// tenth of the engine that visitors load, for one preset.
pub(super) const LANES: usize = if cfg!(target_arch = "wasm32") { 1 } else { 4 };

/// [`LANES`] numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(not(target_arch = "wasm32"), repr(align(16)))]
pub(super) struct Lanes(pub(super) [f32; LANES]);

impl Lanes {
    /// `value` in every lane.
    pub(super) fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    /// Complex numbers side by side.
    pub(super) fn complex(numbers: [Complex<f32>; LANES]) -> Complex<Self> {
        Complex { re: Self(numbers.map(|n| n.re)), im: Self(numbers.map(|n| n.im)) }
    }

    /// The complex number in lane `i`.
    pub(super) fn at(numbers: Complex<Self>, i: usize) -> Complex<f32> {
        Complex { re: numbers.re.0[i], im: numbers.im.0[i] }
    }

    #[inline(always)]
    fn with(self, other: Self, operation: impl Fn(f32, f32) -> f32) -> Self {
        Self(from_fn(|i| operation(self.0[i], other.0[i])))
    }
}

macro_rules! operators {
    ($($operator:ident $name:ident;)*) => {
        $(impl $operator for Lanes {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                self.with(other, f32::$name)
            }
        })*
    };
}

operators! {
    Add add;
    Sub sub;
    Mul mul;
    Div div;
    Rem rem;
}

impl Neg for Lanes {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(f32::neg))
    }
}

impl Zero for Lanes {
    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0.0)
    }

    fn is_zero(&self) -> bool {
        *self == Self::zero()
    }
}

impl One for Lanes {
    #[inline(always)]
    fn one() -> Self {
        Self::splat(1.0)
    }
}

impl FromPrimitive for Lanes {
    fn from_i64(n: i64) -> Option<Self> {
        f32::from_i64(n).map(Self::splat)
    }

    fn from_u64(n: u64) -> Option<Self> {
        f32::from_u64(n).map(Self::splat)
    }

    fn from_f64(n: f64) -> Option<Self> {
        f32::from_f64(n).map(Self::splat)
    }
}

// The transforms require these two traits, but do not use them.

impl Num for Lanes {
    type FromStrRadixErr = <f32 as Num>::FromStrRadixErr;

    fn from_str_radix(text: &str, radix: u32) -> Result<Self, Self::FromStrRadixErr> {
        f32::from_str_radix(text, radix).map(Self::splat)
    }
}

impl Signed for Lanes {
    fn abs(&self) -> Self {
        Self(self.0.map(f32::abs))
    }

    fn abs_sub(&self, other: &Self) -> Self {
        self.with(*other, |a, b| (a - b).max(0.0))
    }

    fn signum(&self) -> Self {
        Self(self.0.map(f32::signum))
    }

    fn is_positive(&self) -> bool {
        self.0.iter().all(|v| v.is_sign_positive())
    }

    fn is_negative(&self) -> bool {
        self.0.iter().all(|v| v.is_sign_negative())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustfft::FftPlannerScalar;

    #[test]
    fn a_lane_has_the_bits_of_a_single_transform() {
        // Large factors take a different code path from small ones.
        for length in [1, 2, 30, 194, 450, 2 * 149] {
            let value = |i: usize| ((i * 7919) % 1013) as f32 / 13.0 - 30.0;
            let number =
                |lane: usize, i: usize| Complex { re: value(lane * 911 + i), im: value(lane * 13 + 5 * i) };
            let mut together: Vec<_> =
                (0..length).map(|i| Lanes::complex(from_fn(|lane| number(lane, i)))).collect();
            FftPlannerScalar::new().plan_fft_inverse(length).process(&mut together);
            for lane in 0..LANES {
                let mut single: Vec<_> = (0..length).map(|i| number(lane, i)).collect();
                FftPlannerScalar::new().plan_fft_inverse(length).process(&mut single);
                let bits = |n: Complex<f32>| [n.re.to_bits(), n.im.to_bits()];
                for (together, single) in together.iter().zip(single) {
                    assert_eq!(
                        bits(Lanes::at(*together, lane)),
                        bits(single),
                        "length {length}, lane {lane}"
                    );
                }
            }
        }
    }
}
