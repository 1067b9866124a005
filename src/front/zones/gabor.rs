//! The bank of Gabor filters, in the frequency domain.
//!
//! The image is continued by reflection, which makes it periodic with twice its size and leaves no step at
//! its borders. One transform of that period serves all filters. A filter passes a Gaussian around its centre
//! frequency. Only that part of the spectrum is transformed back, shifted to frequency 0, which changes the
//! phase of the response but not its magnitude. The magnitude is therefore sampled at only as many nodes as
//! its bandwidth needs: about a fourth of them for each octave of wavelength.
//!
//! Single precision is deliberate. The transforms are plain code of additions and multiplications, the same
//! on every CPU except for their sines and cosines, which `rustfft` takes from the platform in double
//! precision. Rounding to single precision removes the platforms' differences in the last place.

use std::array::from_fn;
use std::f64::consts::SQRT_2;
use std::sync::Arc;

use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlannerScalar};

use super::lanes::{LANES, Lanes};
use crate::front::filter::gaussian;
use crate::front::illumination::smooth;
use crate::image::Plane;
use crate::threads::prelude::*;

/// The shortest wavelength, 4 / sqrt 2 pixels, squared (paper, section 3.1).
const SHORTEST_SQUARED: usize = 8;
/// Bandwidth: the standard deviation of the pass band as a fraction of its centre frequency. The response is
/// half its maximum at 2/3 and 4/3 of the centre frequency, one octave, as in Jain and Farrokhnia, so that
/// neighbouring wavelengths join; the paper does not say. The band is round: the response is half its maximum
/// at 18 degrees to either side, so that orientations 30 degrees apart join as well.
const BANDWIDTH: f64 = 0.283;
/// The part of the band that is kept on either side, in standard deviations.
const BAND_REACH: f64 = 3.0;
/// Standard deviation of the Gaussian that smooths a magnitude, in wavelengths: half a wavelength, which is
/// that of the filter's envelope, times 3, as usual with this bank. The paper does not say.
const SMOOTHING: f64 = 1.5;
/// Radius of the smoothing, in standard deviations.
const SMOOTHING_REACH: f64 = 3.0;

/// The smoothed magnitude of a filter's response, in 8-bit levels: half the amplitude of a wave in its band.
pub(super) struct Response {
    /// Width and height of the image.
    pub(super) pixels: [usize; 2],
    /// Nodes across and down on the doubled image: node i lies at pixel 2 `pixels` / `nodes_per_period` i.
    pub(super) nodes_per_period: [usize; 2],
    /// From the first node of the image to the first beyond its last pixel.
    pub(super) nodes: Plane<f64>,
}

/// Number of orientations (paper, section 3.1).
pub(super) const ORIENTATIONS: usize = 6;

/// Cosine and sine of 0, 30, .. 150 degrees.
fn orientations() -> [[f64; 2]; ORIENTATIONS] {
    let long = 3.0f64.sqrt() / 2.0;
    [[1.0, 0.0], [long, 0.5], [0.5, long], [0.0, 1.0], [-0.5, long], [-long, 0.5]]
}

/// The responses of a plane (in 8-bit levels, mean 0, at least one pixel) to all filters: wavelengths in
/// octaves from 2.83 pixels to the diagonal, with six orientations each.
pub(super) fn bank(plane: &Plane<f32>) -> Vec<Response> {
    let (width, height) = plane.size();
    let diagonal_squared = width * width + height * height;
    let octaves = (diagonal_squared / SHORTEST_SQUARED).checked_ilog(4).map_or(0, |k| k + 1);
    let mut planner = FftPlannerScalar::new();
    let spectrum = Spectrum::new(plane, &mut planner);
    let filters: Vec<Filter> = (0..octaves)
        .flat_map(|k| {
            let wavelength = 2.0 * SQRT_2 * f64::from(1u32 << k);
            let sides = [width, height].map(|n| nodes_per_period(n, wavelength));
            let inverse = sides.map(|n| planner.plan_fft_inverse(n));
            orientations().map(|direction| Filter { wavelength, direction, inverse: inverse.clone() })
        })
        .collect();
    filters.par_iter().map(|filter| filter.response(&spectrum)).collect()
}

/// Number of nodes that a magnitude needs on a doubled side of `n` pixels: one for each frequency of the
/// band, at least 4, rounded up to a product of 2, 3 and 5, and never more than there are pixels.
fn nodes_per_period(n: usize, wavelength: f64) -> usize {
    let band = (2.0 * BAND_REACH * BANDWIDTH * (2 * n) as f64 / wavelength).ceil() as usize;
    (band.max(4)..2 * n).find(|m| has_small_factors(*m)).unwrap_or(2 * n)
}

/// Whether `n`, which is not 0, is a product of 2, 3 and 5.
fn has_small_factors(mut n: usize) -> bool {
    for factor in [2, 3, 5] {
        while n.is_multiple_of(factor) {
            n /= factor;
        }
    }
    n == 1
}

/// The transform of the doubled image.
struct Spectrum {
    /// Width and height of the image.
    pixels: [usize; 2],
    /// By column: \[u\]\[v\].
    data: Vec<Complex<f32>>,
}

impl Spectrum {
    fn new(plane: &Plane<f32>, planner: &mut FftPlannerScalar<Lanes>) -> Self {
        let (width, height) = plane.size();
        let (across, down) = (planner.plan_fft_forward(2 * width), planner.plan_fft_forward(2 * height));
        // The lower half repeats the upper one: its rows need no transform of their own.
        let mut rows = vec![Complex::default(); 2 * width * height];
        rows.par_chunks_mut(LANES * 2 * width).enumerate().for_each_init(Vec::new, |lanes, (group, out)| {
            // The last group may repeat the last row.
            let group = from_fn(|i| plane.row((LANES * group + i).min(height - 1)));
            let values = |x: usize| Lanes(group.map(|row: &[f32]| row[x]));
            lanes.clear();
            lanes.extend(
                (0..width).chain((0..width).rev()).map(|x| Complex { re: values(x), im: Lanes::splat(0.0) }),
            );
            across.process(lanes);
            for (i, out) in out.chunks_exact_mut(2 * width).enumerate() {
                out.iter_mut().zip(&*lanes).for_each(|(out, lanes)| *out = Lanes::at(*lanes, i));
            }
        });
        let mut data = vec![Complex::default(); 4 * width * height];
        data.par_chunks_mut(LANES * 2 * height).enumerate().for_each_init(Vec::new, |lanes, (group, out)| {
            lanes.clear();
            lanes.extend((0..2 * height).map(|v| {
                let row = &rows[v.min(2 * height - 1 - v) * 2 * width..][..2 * width];
                Lanes::complex(from_fn(|i| row[(LANES * group + i).min(2 * width - 1)]))
            }));
            down.process(lanes);
            for (i, out) in out.chunks_exact_mut(2 * height).enumerate() {
                out.iter_mut().zip(&*lanes).for_each(|(out, lanes)| *out = Lanes::at(*lanes, i));
            }
        });
        Self { pixels: [width, height], data }
    }
}

/// One filter of the bank.
struct Filter {
    /// Wavelength in pixels.
    wavelength: f64,
    /// Cosine and sine of the orientation.
    direction: [f64; 2],
    /// The transforms from its band to its nodes, across and down.
    inverse: [Arc<dyn Fft<Lanes>>; 2],
}

impl Filter {
    #[cfg_attr(
        target_arch = "wasm32",
        expect(clippy::modulo_one, reason = "a browser has groups of one line")
    )]
    fn response(&self, spectrum: &Spectrum) -> Response {
        let [across, down] = &self.inverse;
        let nodes_per_period = [across.len(), down.len()];
        let bands = [0, 1].map(|axis| self.band(axis, spectrum.pixels[axis]));
        // Nodes 0 to the one after the last pixel. If there are too few nodes for that, they wrap around.
        let [columns, lines] = [0, 1].map(|axis| {
            (spectrum.pixels[axis] - 1) * nodes_per_period[axis] / (2 * spectrum.pixels[axis]) + 2
        });

        let period = 2 * spectrum.pixels[1];
        // Groups of lines side by side, each from left to right.
        let mut groups =
            vec![Lanes::complex([Complex::default(); LANES]); lines.div_ceil(LANES) * across.len()];
        let mut column = vec![Lanes::complex([Complex::default(); LANES]); down.len()];
        for (group, us) in bands[0].chunks(LANES).enumerate() {
            // The last group may repeat its last column.
            let us: [(usize, f32); LANES] = from_fn(|i| us[i.min(us.len() - 1)]);
            for (out, (v, pass_v)) in column.iter_mut().zip(&bands[1]) {
                *out =
                    Lanes::complex(us.map(|(u, pass_u)| spectrum.data[u * period + v] * (pass_u * pass_v)));
            }
            down.process(&mut column);
            for j in 0..lines {
                let values = column[j % column.len()];
                let out = &mut groups[j / LANES * across.len()..][..across.len()][LANES * group..];
                for (i, out) in out.iter_mut().take(LANES).enumerate() {
                    let value = Lanes::at(values, i);
                    (out.re.0[j % LANES], out.im.0[j % LANES]) = (value.re, value.im);
                }
            }
        }
        across.process(&mut groups);
        let mut magnitudes = Plane::filled(columns, lines, 0.0);
        let groups = groups.chunks_exact(across.len());
        for (out, group) in magnitudes.data_mut().chunks_mut(LANES * columns).zip(groups) {
            for i in 0..columns {
                let Complex { re: Lanes(re), im: Lanes(im) } = group[i % across.len()];
                let magnitude: [f32; LANES] =
                    from_fn(|lane| (re[lane] * re[lane] + im[lane] * im[lane]).sqrt());
                out[i..].iter_mut().step_by(columns).zip(magnitude).for_each(|(out, v)| *out = v.into());
            }
        }

        let kernels = [0, 1].map(|axis| {
            let spacing = (2 * spectrum.pixels[axis]) as f64 / nodes_per_period[axis] as f64;
            let sigma = SMOOTHING * self.wavelength / spacing;
            gaussian(sigma, (SMOOTHING_REACH * sigma).ceil() as usize)
        });
        let smoothed = smooth(&magnitudes, [&kernels[0], &kernels[1]]);
        Response { pixels: spectrum.pixels, nodes_per_period, nodes: smoothed }
    }

    /// The frequencies of the band on one axis, as indices into the spectrum, and the filter's gain at each.
    /// The gain includes the normalisation, which the transforms leave out.
    fn band(&self, axis: usize, pixels: usize) -> Vec<(usize, f32)> {
        let (period, count) = (2 * pixels as isize, self.inverse[axis].len() as isize);
        let centre = self.direction[axis] / self.wavelength * period as f64;
        let sigma = BANDWIDTH / self.wavelength * period as f64;
        let first = centre.round() as isize - count / 2;
        (first..first + count)
            .map(|u| {
                let x = (u as f64 - centre) / sigma;
                (u.rem_euclid(period) as usize, (libm::exp(-x * x / 2.0) / period as f64) as f32)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// A wave with an amplitude of 20 levels, at an octave and an orientation of the bank.
    fn wave(octave: usize, orientation: usize) -> Plane<f32> {
        let wavelength = 2.0 * SQRT_2 * f64::from(1 << octave);
        let [cos, sin] = orientations()[orientation];
        let phase = |x: usize, y: usize| 2.0 * PI * (x as f64 * cos + y as f64 * sin) / wavelength;
        Plane::from_fn(150, 130, |x, y| (20.0 * phase(x, y).cos()) as f32)
    }

    fn at_centre(response: &Response) -> f64 {
        let [x, y] = [0, 1].map(|axis| response.nodes_per_period[axis] / 4);
        response.nodes[(x, y)]
    }

    #[test]
    fn a_wave_answers_in_its_own_filter_with_half_its_amplitude() {
        // Longer waves are affected by the borders even at the centre.
        for octave in 0..3 {
            for orientation in 0..6 {
                let answers: Vec<f64> = bank(&wave(octave, orientation)).iter().map(at_centre).collect();
                assert_eq!(answers.len(), 7 * 6);
                let own = octave * 6 + orientation;
                let name = format!("octave {octave}, orientation {orientation}");
                assert!((answers[own] - 10.0).abs() < 0.5, "{name}: {}", answers[own]);
                let loudest =
                    (0..answers.len()).filter(|i| *i != own).map(|i| answers[i]).fold(0.0, f64::max);
                assert!(loudest < 0.75 * answers[own], "{name}: {loudest} elsewhere");
            }
        }
    }

    #[test]
    fn nodes_suffice_and_transform_fast() {
        assert_eq!(nodes_per_period(450, 2.0 * SQRT_2), 576);
        assert_eq!(nodes_per_period(1, 2.0 * SQRT_2), 2);
        assert_eq!(nodes_per_period(500, 1000.0), 4);
        assert!(has_small_factors(1) && has_small_factors(360) && !has_small_factors(14));
    }
}
