//! Separable integer filters.
//!
//! The border pixels are repeated beyond the image. A masked pixel is replaced by the previous unmasked one
//! in its row, or by the first; a masked row by the unmasked one above, or by the first.

use bytemuck::{Pod, cast_slice, cast_slice_mut};
use std::borrow::Cow;

use crate::image::cubic::{BITS, WEIGHTS};
use crate::image::{Image, Pixel, Plane, grey};
use crate::maps::FRACTION;
use crate::threads::prelude::*;

/// Values that filters work on: one or more 16-bit numbers per pixel.
pub(super) trait Pixels: Pod + Send + Sync {}

impl<T: Pod + Send + Sync> Pixels for T {}

/// Weights of a Gaussian of `sigma` pixels at -`radius` ..= `radius`; they sum to 1.
pub(super) fn gaussian(sigma: f64, radius: usize) -> Vec<f64> {
    let weight = |i: usize| {
        let x = i.abs_diff(radius) as f64 / sigma;
        libm::exp(-x * x / 2.0)
    };
    let weights: Vec<f64> = (0..=2 * radius).map(weight).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| w / sum).collect()
}

/// Weights of adjacent pixels; they sum to 2 to [`BITS`].
struct Taps {
    /// The position of the first, relative to the output pixel.
    first: isize,
    weights: Vec<i32>,
}

impl Taps {
    /// A Gaussian of `sigma` pixels; the centre absorbs the rounding errors.
    fn gaussian(sigma: f64) -> Self {
        let radius = (3.0 * sigma).ceil() as usize;
        let whole = f64::from(1 << BITS);
        let mut weights: Vec<i32> =
            gaussian(sigma, radius).iter().map(|w| (w * whole).round() as i32).collect();
        weights[radius] += (1 << BITS) - weights.iter().sum::<i32>();
        Self { first: -(radius as isize), weights }
    }
}

/// Moves the image up by `offset`, in 1/256 px. Rows from outside and masked pixels are masked.
pub(super) fn moved(image: &Image, offset: i32) -> Image {
    let (rows, part) = (offset.div_euclid(FRACTION) as isize, offset.rem_euclid(FRACTION));
    let nearest = |y: usize| {
        let y = y as isize + rows + isize::from(2 * part >= FRACTION);
        usize::try_from(y).ok().filter(|&y| y < image.height())
    };
    let weights = WEIGHTS[part as usize].to_vec();
    let pixels = down(&unmasked(&image.pixels, &image.masked), &Taps { first: rows - 1, weights });
    let (width, height) = image.pixels.size();
    let masked = Plane::from_fn(width, height, |x, y| nearest(y).is_none_or(|y| image.masked[(x, y)]));
    Image { pixels, masked }
}

/// Doubles the size of an image, by cubics (Keys 1981, with a slope of -3/4, which keeps fine detail). The four pixels that
/// a pixel becomes lie a quarter of a pixel off its centre, so the image stays centred; they are masked if the pixel is.
///
/// If all values are whole 8-bit levels, they stay so: fractions of a level would be mistaken for texture.
pub(super) fn doubled(image: &Image) -> Image {
    const WEIGHTS: [i32; 4] = [-1728, 14_400, 4288, -576];
    let before = Taps { first: -2, weights: WEIGHTS.into_iter().rev().collect() };
    let after = Taps { first: -1, weights: WEIGHTS.into() };
    let (width, height) = image.pixels.size();
    let seen = unmasked(&image.pixels, &image.masked);
    let quarters = [&before, &after].map(|taps| {
        let half = down(&seen, taps);
        [&before, &after].map(|taps| across(&half, taps))
    });
    let bytes = image.holds_bytes();
    let pixel = |[r, g, b, of_all]: Pixel| {
        if !bytes {
            return [r, g, b, of_all];
        }
        let [r, g, b] = [r, g, b].map(|v| v.saturating_add(128) & 0xff00);
        [r, g, b, grey(r, g, b)]
    };
    let mut pixels = Plane::filled(2 * width, 2 * height, [0; 4]);
    pixels.data_mut().par_chunks_mut(2 * width).enumerate().for_each(|(y, row)| {
        let [left, right] = quarters[y % 2].each_ref().map(|quarter| quarter.row(y / 2));
        let pairs = left.iter().zip(right).map(|(l, r)| [pixel(*l), pixel(*r)]);
        row.chunks_exact_mut(2).zip(pairs).for_each(|(two, pair)| two.copy_from_slice(&pair));
    });
    let masked = Plane::from_fn(2 * width, 2 * height, |x, y| image.masked[(x / 2, y / 2)]);
    Image { pixels, masked }
}

/// Smooths an image by a Gaussian of `sigma` pixels.
pub(super) fn smoothed(image: &Image, sigma: f64) -> Image {
    Image { pixels: smooth(&image.pixels, &image.masked, sigma), masked: image.masked.clone() }
}

/// Smooths pixels of any type.
pub(super) fn smooth<T: Pixels>(pixels: &Plane<T>, masked: &Plane<bool>, sigma: f64) -> Plane<T> {
    let taps = Taps::gaussian(sigma);
    across(&down(&unmasked(pixels, masked), &taps), &taps)
}

/// The pixels of an image, with masked ones replaced.
fn unmasked<'a, T: Pixels>(pixels: &'a Plane<T>, masked: &Plane<bool>) -> Cow<'a, Plane<T>> {
    let mut pixels = Cow::Borrowed(pixels);
    let all_masked = |y: usize| !masked.row(y).contains(&false);
    let Some(first) = (0..masked.height()).find(|&y| !all_masked(y)) else { return pixels };
    for y in (first..masked.height()).filter(|&y| masked.row(y).contains(&true)) {
        let pixels = pixels.to_mut();
        if all_masked(y) {
            let (above, row) = pixels.rows_mut(y - 1..y + 1).split_at_mut(masked.width());
            row.copy_from_slice(above);
            continue;
        }
        let (row, masked) = (pixels.row_mut(y), masked.row(y));
        let mut last =
            masked.iter().zip(&*row).find(|(masked, _)| !**masked).map_or(T::zeroed(), |found| *found.1);
        for (pixel, masked) in row.iter_mut().zip(masked) {
            if *masked {
                *pixel = last;
            }
            last = *pixel;
        }
    }
    if first > 0 {
        let row = pixels.row(first).to_vec();
        (0..first).for_each(|y| pixels.to_mut().row_mut(y).copy_from_slice(&row));
    }
    pixels
}

/// Filters along columns.
fn down<T: Pixels>(pixels: &Plane<T>, taps: &Taps) -> Plane<T> {
    let (width, height) = pixels.size();
    let mut out = Plane::filled(width, height, T::zeroed());
    out.data_mut().par_chunks_mut(width).enumerate().for_each_init(Vec::new, |sums, (y, out)| {
        let row = |place: isize| (y as isize + place).clamp(0, height as isize - 1) as usize;
        let rows: Vec<&[u16]> =
            (taps.first..).take(taps.weights.len()).map(|i| cast_slice(pixels.row(row(i)))).collect();
        weigh(&taps.weights, &rows, sums, cast_slice_mut(out));
    });
    out
}

/// Filters along rows.
fn across<T: Pixels>(pixels: &Plane<T>, taps: &Taps) -> Plane<T> {
    let (width, height) = pixels.size();
    let mut out = Plane::filled(width, height, T::zeroed());
    out.data_mut().par_chunks_mut(width).enumerate().for_each_init(Vec::new, |sums, (y, out)| {
        let row = pixels.row(y);
        let column = |place: isize| place.clamp(0, width as isize - 1) as usize;
        let longer: Vec<T> =
            (taps.first..).take(width + taps.weights.len() - 1).map(|x| row[column(x)]).collect();
        let places: Vec<&[u16]> = longer.windows(width).map(cast_slice).collect();
        weigh(&taps.weights, &places, sums, cast_slice_mut(out));
    });
    out
}

/// Sums of `terms` by their weights; `sums` is scratch memory.
#[pulp::with_simd(weigh = crate::vectors::widest())]
#[inline(always)]
fn weigh_on<'a, S: pulp::Simd>(
    _: S,
    weights: &'a [i32],
    terms: &'a [&'a [u16]],
    sums: &'a mut Vec<i32>,
    out: &'a mut [u16],
) {
    sums.clear();
    sums.resize(out.len(), 1 << (BITS - 1));
    for (weight, term) in weights.iter().zip(terms) {
        for (sum, v) in sums.iter_mut().zip(*term) {
            *sum += weight * i32::from(*v);
        }
    }
    for (out, sum) in out.iter_mut().zip(sums) {
        *out = (*sum >> BITS).clamp(0, 0xffff) as u16;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: usize, height: usize, grey: impl Fn(usize, usize) -> u16) -> Image {
        let pixels = Plane::from_fn(width, height, |x, y| [grey(x, y); 4]);
        Image { pixels, masked: Plane::filled(width, height, false) }
    }

    #[test]
    fn whole_rows_are_copied_and_others_interpolated() {
        let slope = image(3, 20, |x, y| (1000 * x + 512 * y) as u16);
        for rows in [-3, 0, 2] {
            let there = moved(&slope, rows * FRACTION);
            for y in 0..20 {
                let from = y as i32 + rows;
                assert_eq!(there.masked[(1, y)], !(0..20).contains(&from), "row {y}, moved by {rows}");
                if !there.masked[(1, y)] {
                    assert_eq!(there.pixels.row(y), slope.pixels.row(from as usize));
                }
            }
        }
        // Cubic convolution keeps a slope.
        let there = moved(&slope, FRACTION / 4);
        assert!((1..18).all(|y| there.pixels[(2, y)][0] == slope.pixels[(2, y)][0] + 128));
        assert!(there.masked.data().iter().all(|masked| !masked));
        let there = moved(&slope, FRACTION * 3 / 4);
        assert_eq!(
            there.masked.data().iter().filter(|masked| **masked).count(),
            3,
            "the last row is outside"
        );
    }

    #[test]
    fn a_gaussian_has_its_width_and_keeps_the_sum() {
        for sigma in [0.7, 1.0, 2.8] {
            let spot = smoothed(&image(41, 41, |x, y| if (x, y) == (20, 20) { 60_000 } else { 0 }), sigma);
            let moment = |power: i32| -> f64 {
                let columns = (0..41).map(|x| (x as f64 - 20.0, f64::from(spot.pixels[(x, 20)][0])));
                columns.map(|(x, v)| x.powi(power) * v).sum()
            };
            let found = (moment(2) / moment(0)).sqrt();
            assert!((found - sigma).abs() < 0.06 * sigma, "{found} for {sigma}");
            let even = image(9, 7, |_, _| 43_210);
            assert_eq!(smoothed(&even, sigma), even);
        }
    }

    #[test]
    fn a_doubled_slope_is_half_as_steep() {
        let slope = doubled(&image(12, 10, |x, y| (4096 * x + 513 * y + 1) as u16));
        assert_eq!(slope.pixels.size(), (24, 20));
        // Pixels lie a quarter to both sides of their source; the filter is slightly steeper there.
        for (x, y) in [(10, 9), (11, 8), (12, 12)] {
            let expected = 2048.0 * (x as f64 - 0.5) + 256.5 * (y as f64 - 0.5) + 1.0;
            let found = f64::from(slope.pixels[(x, y)][3]);
            assert!((found - expected).abs() < 300.0, "{found} for {expected}");
        }
        let even = doubled(&image(9, 7, |_, _| 43_210));
        assert_eq!(even, image(18, 14, |_, _| 43_210));
        // Whole levels stay whole.
        let levels = image(9, 7, |x, y| ((x * 37 + y * 101) % 256 * 256) as u16);
        assert!(doubled(&levels).holds_bytes());
    }

    #[test]
    fn masked_pixels_have_no_influence() {
        let with = |hidden: u16| {
            let mut image = image(12, 9, |x, y| (97 * x * y) as u16);
            for (x, y) in [(5, 4), (0, 7), (11, 8)].into_iter().chain((0..12).flat_map(|x| [(x, 0), (x, 6)]))
            {
                image.masked[(x, y)] = true;
                image.pixels[(x, y)] = [hidden; 4];
            }
            image
        };
        let seen = |image: Image| {
            let pixels = image.pixels.data().iter().zip(image.masked.data());
            pixels.map(|(pixel, masked)| (!masked).then_some(*pixel)).collect::<Vec<_>>()
        };
        for filter in [|image: &Image| moved(image, 100), |image: &Image| smoothed(image, 1.0), doubled] {
            assert!(seen(filter(&with(0))) == seen(filter(&with(65_535))));
        }
    }
}
