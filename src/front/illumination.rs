//! Homomorphic filtering: removes differences of illumination between the two images (paper, section 3.1).
//!
//! A pixel's luminance is illumination times reflectance, and illumination changes slowly across the image.
//! So the local geometric mean, which is the low-pass of the logarithm, stands for illumination, and dividing
//! by it leaves reflectance. The paper gives only the size of the filter, 21 x 21; the rest is decided here.

use super::filter::gaussian;
use crate::image::{Image, Pixel, Plane, grey};
use crate::threads::prelude::*;

/// Radius of the filter in pixels: 21 x 21 in all, as in the paper.
const RADIUS: usize = 10;
/// Sigma of the low-pass, in pixels. It is the widest that still falls off, to exp(-2) at the sides of the
/// window. The low-pass should remove illumination only; a narrower one removes more texture as well.
const SIGMA: f64 = RADIUS as f64 / 2.0;
/// Target for a pixel as bright as its surroundings, in 1/256 of an 8-bit level. A higher value leaves less
/// room for brighter pixels, a lower one less contrast. At 128 levels a channel saturates in 10 % of the
/// pixels of Middlebury's Motorcycle, at 80 in 1.0 %, at 64 in 0.3 % (Dolls 0.2 % at 80, Teddy 0.03 %).
const MID_GREY: f64 = 80.0 * 256.0;
/// The smallest luminance that enters the logarithm, as a fraction of the image's mean: about half a level of
/// an 8-bit image, below which differences mean nothing. It is relative, so that a gain changes nothing.
const DARKEST: f64 = 1.0 / 256.0;

/// The image with its illumination evened out: log, minus low-pass, exp.
///
/// The low-pass is a Gaussian (sigma 5 pixels) of 21 x 21 pixels over the unmasked pixels, with the image
/// reflected at its borders. A pixel as bright as the geometric mean of its surroundings becomes 80 levels,
/// and one half as bright becomes 40. A pixel more than 3.2 times as bright saturates. This scale is fixed,
/// so both images of a pair share it, and a gain of the whole image cancels except for rounding.
///
/// Each colour is corrected by the gain of the luminance. Filtering the channels one by one would lose every
/// large colour: a red wall and a green one would both become grey, and colour is half of what tells surfaces
/// apart.
///
/// Masked pixels stay masked and keep their values. An image that is black or entirely masked is returned
/// unchanged.
#[must_use]
pub fn homomorphic(image: &Image) -> Image {
    let (pixels, masked) = (image.pixels.data(), image.masked.data());
    let visible = || pixels.iter().zip(masked).filter(|(_, masked)| !**masked).map(|(p, _)| u64::from(p[3]));
    let (sum, count) = (visible().sum::<u64>(), visible().count());
    if sum == 0 {
        return image.clone();
    }
    let darkest = DARKEST * sum as f64 / count as f64;
    let log = |(p, masked): (&Pixel, &bool)| {
        if *masked { 0.0 } else { libm::log(f64::from(p[3]).max(darkest) / darkest) }
    };
    let plane = |values| Plane::new(image.width(), image.height(), values);
    let kernel = gaussian(SIGMA, RADIUS);
    let low_pass = |values: &Plane<f64>| smooth(values, [&kernel, &kernel]);
    let logs = low_pass(&plane(pixels.par_iter().zip(masked).map(log).collect()));
    // The low-pass of the logarithm over the low-pass of the weight is the mean over unmasked pixels. Without
    // masked pixels, the weight is the same everywhere.
    let weights =
        masked.contains(&true).then(|| low_pass(&plane(masked.iter().map(|m| f64::from(!m)).collect())));
    let one = low_pass(&Plane::filled(1, 1, 1.0))[(0, 0)];
    let width = image.width();
    let mut corrected = image.clone();
    corrected.pixels.data_mut().par_chunks_exact_mut(width).enumerate().for_each(|(y, pixels)| {
        let weight = |x: usize| weights.as_ref().map_or(one, |weights| weights[(x, y)]);
        let gain = |(x, log): (usize, &f64)| MID_GREY / darkest * libm::exp(-log / weight(x));
        let gains: Vec<f64> = logs.row(y).iter().enumerate().map(gain).collect();
        correct(image.masked.row(y), &gains, pixels);
    });
    corrected
}

/// Multiplies the colours of unmasked pixels by their gains.
#[pulp::with_simd(correct = crate::vectors::widest())]
#[inline(always)]
fn correct_on<'a, S: pulp::Simd>(_: S, masked: &'a [bool], gains: &'a [f64], pixels: &'a mut [Pixel]) {
    for ((pixel, gain), masked) in pixels.iter_mut().zip(gains).zip(masked) {
        if !masked {
            let [r, g, b] = [pixel[0], pixel[1], pixel[2]].map(|v| (f64::from(v) * gain).round() as u16);
            *pixel = [r, g, b, grey(r, g, b)];
        }
    }
}

/// Index `i` reflected into 0 .. `n`: -1 becomes 0, n becomes n - 1.
fn reflected(i: isize, n: usize) -> usize {
    let i = i.rem_euclid(2 * n as isize) as usize;
    i.min(2 * n - 1 - i)
}

/// A plane convolved across and down with symmetric kernels of odd length, reflected at its borders. Rows run
/// in parallel. Each sum is taken in one order, so the number of threads changes nothing.
pub(super) fn smooth(plane: &Plane<f64>, [across, down]: [&[f64]; 2]) -> Plane<f64> {
    let (width, height) = plane.size();
    let (right, below) = (across.len() / 2, down.len() / 2);
    let mut rows = Plane::filled(width, height, 0.0);
    rows.data_mut().par_chunks_exact_mut(width).enumerate().for_each(|(y, out)| {
        let row = plane.row(y);
        let at = |i: usize| row[reflected(i as isize - right as isize, width)];
        let extended: Vec<_> = (0..width + 2 * right).map(at).collect();
        let terms: Vec<_> = extended.windows(width).collect();
        add_all(across, &terms, out);
    });
    let mut smoothed = Plane::filled(width, height, 0.0);
    smoothed.data_mut().par_chunks_exact_mut(width).enumerate().for_each(|(y, out)| {
        let row = |i: usize| rows.row(reflected((y + i) as isize - below as isize, height));
        let terms: Vec<_> = (0..down.len()).map(row).collect();
        add_all(down, &terms, out);
    });
    smoothed
}

/// Adds weighted rows, one after the other.
#[pulp::with_simd(add_all = crate::vectors::widest())]
#[inline(always)]
fn add_all_on<'a, S: pulp::Simd>(_: S, weights: &'a [f64], rows: &'a [&'a [f64]], out: &'a mut [f64]) {
    for (weight, row) in weights.iter().zip(rows) {
        out.iter_mut().zip(*row).for_each(|(sum, value)| *sum += weight * value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflection_repeats_the_border_pixel() {
        let folded: Vec<usize> = (-4..8).map(|i| reflected(i, 3)).collect();
        assert_eq!(folded, [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0, 1]);
        assert_eq!(reflected(-7, 1), 0);
    }

    #[test]
    fn smoothing_is_the_sum_over_the_window() {
        let plane = Plane::from_fn(5, 4, |x, y| ((x * 7 + y * 13) % 11) as f64);
        let (across, down) = (gaussian(2.0, 6), gaussian(1.0, 3));
        let smoothed = smooth(&plane, [&across, &down]);
        for y in 0..4 {
            for x in 0..5 {
                let mut sum = 0.0;
                for (j, wy) in down.iter().enumerate() {
                    for (i, wx) in across.iter().enumerate() {
                        let (x, y) = (x as isize + i as isize - 6, y as isize + j as isize - 3);
                        sum += wx * wy * plane[(reflected(x, 5), reflected(y, 4))];
                    }
                }
                let actual = smoothed[(x, y)];
                assert!((actual - sum).abs() < 1e-12, "({x}, {y}): {actual} instead of {sum}");
            }
        }
    }
}
