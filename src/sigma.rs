//! The expected error of a disparity, in pixels, from its confidence.

use crate::image::Plane;
use crate::maps::{Maps, flag};
use crate::options::{MatchSize, Method};

/// How the error falls as the confidence rises: sigma(c) = sqrt(floor^2 + (`at_zero` 2^(-c / `halving`))^2).
///
/// Read as a standard deviation: about two thirds of the measured pixels with confidence c are closer to the truth than
/// sigma(c). The errors have longer tails than a normal distribution: one pixel in twenty is off by more than three
/// sigma, on roads one in ten. The parameters were fitted (open) to the errors of 48 pairs of desks, rooms and roads
/// with the presets `default`, `accurate` and `fast`. For other methods they hold as far as the confidence is similar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sigma {
    /// The error at the highest confidence, in pixels: sampling, noise, and errors of the ground truth.
    floor: f64,
    /// The falling part at confidence 0, in pixels.
    at_zero: f64,
    /// The confidence by which the falling part halves.
    halving: f64,
}

impl Sigma {
    /// The model for the maps of `method`.
    #[must_use]
    pub fn for_method(method: &Method) -> Self {
        match method.schedule.match_size {
            MatchSize::Full | MatchSize::Double => Self { floor: 0.2, at_zero: 2.6, halving: 15.0 },
            // Its confidence has smaller steps: after fewer iterations, the best label leads by less.
            MatchSize::Half => Self { floor: 0.23, at_zero: 1.4, halving: 7.5 },
        }
    }

    /// The expected error of a measured pixel with this `confidence`, in pixels.
    #[must_use]
    pub fn at(&self, confidence: u8) -> f32 {
        let falling = self.at_zero * libm::exp2(-f64::from(confidence) / self.halving);
        (self.floor * self.floor + falling * falling).sqrt() as f32
    }

    /// The expected error of every pixel; `+inf` where nothing was measured, even if it was filled in.
    #[must_use]
    pub fn map(&self, maps: &Maps) -> Plane<f32> {
        let of_each: Vec<f32> = (0..=u8::MAX).map(|confidence| self.at(confidence)).collect();
        let (width, height) = maps.confidence.size();
        Plane::from_fn(width, height, |x, y| {
            let measured = maps.validity[(x, y)] & flag::INVALID == 0;
            if measured { of_each[usize::from(maps.confidence[(x, y)])] } else { f32::INFINITY }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_falls_to_its_floor() {
        for method in [Method::default(), Method::accurate(), Method::fast()] {
            let sigma = Sigma::for_method(&method);
            let all: Vec<f32> = (0..=u8::MAX).map(|confidence| sigma.at(confidence)).collect();
            assert!(all.is_sorted_by(|a, b| a >= b));
            assert!(f64::from(all[0]) > sigma.at_zero && f64::from(all[255]) < sigma.floor + 1e-6);
        }
        assert!(Sigma::for_method(&Method::fast()).at(20) < Sigma::for_method(&Method::default()).at(20));
    }

    #[test]
    fn unmeasured_pixels_have_no_sigma() {
        let row = |values: &[u8]| Plane::new(values.len(), 1, values.to_vec());
        let validity = row(&[
            0,
            flag::LOW_CONFIDENCE,
            flag::OCCLUDED | flag::FILLED,
            flag::MASKED,
            flag::OUTVOTED | flag::FILLED,
        ]);
        let disparity = Plane::new(5, 1, vec![0; 5]);
        let confidence = row(&[60, 10, 0, 0, 60]);
        let maps = Maps { raw: disparity.clone(), disparity, confidence, validity, right: None };
        let sigma = Sigma::for_method(&Method::default());
        let none = f32::INFINITY;
        assert_eq!(sigma.map(&maps).data(), [sigma.at(60), sigma.at(10), none, none, none]);
    }
}
