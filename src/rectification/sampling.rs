//! Resamples images by cubic interpolation in integers.

use crate::error::Result;
use crate::image::cubic::{BITS, STEPS, WEIGHTS};
use crate::image::{Image, Pixel, Plane, grey};
use crate::memory;
use crate::threads;
use crate::threads::prelude::*;

/// A position in an image: x and y, in 1/[`STEPS`] px.
pub(super) type Place = [i32; 2];

/// A position outside every image.
pub(super) const NOWHERE: Place = [i32::MIN; 2];

/// The nearest position to x and y.
pub(super) fn place(at: [f64; 2]) -> Place {
    // Values that are not finite or far away end up outside too.
    at.map(|v| (v * STEPS as f64 + 0.5).floor() as i32)
}

/// Samples `image` at the positions that `source` gives for each pixel of an image of `size`. A pixel is masked
/// if a masked or outside pixel contributes to it. With `bytes`, values are rounded to whole 8-bit levels.
///
/// # Errors
/// [`Error::Memory`](crate::Error::Memory) when the system has too little memory.
pub(super) fn resample(
    image: &Image,
    (width, height): (usize, usize),
    bytes: bool,
    source: impl Fn(usize, usize) -> Place + Sync,
) -> Result<Image> {
    let mut pixels: Vec<Pixel> = memory::filled(width * height, [0; 4])?;
    let mut masked = memory::filled(width * height, true)?;
    let any_masked = image.any_masked();
    let rows = pixels.par_chunks_mut(width).zip(masked.par_chunks_mut(width)).enumerate();
    let of_row = |colours: &mut Vec<Colour>, (y, (pixels, masked)): (usize, (&mut [Pixel], &mut [bool]))| {
        colours.clear();
        colours.resize(width, Colour::default());
        sample_row(image, any_masked, |x| source(x, y), (colours, masked));
        round_row(colours.as_flattened(), bytes, pixels.as_flattened_mut());
        grey_row(pixels);
    };
    threads::run(|| rows.for_each_init(Vec::new, of_row));
    Ok(Image { pixels: Plane::new(width, height, pixels), masked: Plane::new(width, height, masked) })
}

/// Samples the colours of a row, and unmasks the pixels that have one.
#[pulp::with_simd(sample_row = crate::vectors::widest())]
#[inline(always)]
fn sample_row_on<'a, S: pulp::Simd, F: Fn(usize) -> Place>(
    _: S,
    image: &'a Image,
    any_masked: bool,
    source: F,
    (colours, masked): (&'a mut [Colour], &'a mut [bool]),
) {
    for (x, (colour, masked)) in colours.iter_mut().zip(masked).enumerate() {
        if let Some(found) = sample(image, any_masked, source(x)) {
            (*colour, *masked) = (found, false);
        }
    }
}

/// Rounds colours to values. With `bytes`, they are whole 8-bit levels.
#[pulp::with_simd(round_row = crate::vectors::widest())]
#[inline(always)]
fn round_row_on<'a, S: pulp::Simd>(_: S, colours: &'a [f64], bytes: bool, out: &'a mut [u16]) {
    const ONE: f64 = (1u64 << (2 * BITS)) as f64;
    // A whole number ends up in the lower bits of such a sum.
    const WHOLE: f64 = (1u64 << 52) as f64;
    for (out, colour) in out.iter_mut().zip(colours) {
        let level = ((colour + 0.5 * ONE) * (1.0 / ONE)).floor().max(0.0).min(f64::from(u16::MAX));
        let level = (level + WHOLE).to_bits() as u32;
        *out = if bytes { (((level + 128) >> 8).min(255) << 8) as u16 } else { level as u16 };
    }
}

/// Sets the grey of each pixel.
#[pulp::with_simd(grey_row = crate::vectors::widest())]
#[inline(always)]
fn grey_row_on<S: pulp::Simd>(_: S, pixels: &mut [Pixel]) {
    for pixel in pixels {
        pixel[3] = grey(pixel[0], pixel[1], pixel[2]);
    }
}

/// Red, green, blue and an unused value, times 2^28: integers, which doubles represent exactly up to 2^53.
type Colour = [f64; 4];

/// The colour at `at`.
#[inline(always)]
fn sample(image: &Image, any_masked: bool, at: Place) -> Option<Colour> {
    let [(x, across), (y, down)] = at.map(|steps| {
        let steps = i64::from(steps);
        (steps.div_euclid(STEPS), &WEIGHTS[steps.rem_euclid(STEPS) as usize])
    });
    sample_inside(image, any_masked, [x, y], across, down)
        .or_else(|| sample_anywhere(image, [x, y], across, down))
}

/// The colour around the pixel (x, y), by weights along row and column.
fn sample_anywhere(image: &Image, [x, y]: [i64; 2], across: &[i32; 4], down: &[i32; 4]) -> Option<Colour> {
    let (width, height) = image.pixels.size();
    let mut sum = Colour::default();
    for (y, down) in (y.saturating_sub(1)..).zip(down).filter(|(_, weight)| **weight != 0) {
        let y = usize::try_from(y).ok().filter(|y| *y < height)?;
        let (pixels, masked) = (image.pixels.row(y), image.masked.row(y));
        let mut row = [0.0; 4];
        for (x, across) in (x.saturating_sub(1)..).zip(across).filter(|(_, weight)| **weight != 0) {
            let x = usize::try_from(x).ok().filter(|x| *x < width && !masked[*x])?;
            for (sum, value) in row.iter_mut().zip(pixels[x]) {
                *sum += f64::from(*across) * f64::from(value);
            }
        }
        for (sum, row) in sum.iter_mut().zip(row) {
            *sum += f64::from(*down) * row;
        }
    }
    Some(sum)
}

/// The same, if all sixteen pixels around (x, y) are inside the image and unmasked: the usual and faster case.
#[inline(always)]
fn sample_inside(
    image: &Image,
    any_masked: bool,
    [x, y]: [i64; 2],
    across: &[i32; 4],
    down: &[i32; 4],
) -> Option<Colour> {
    let first = |v: i64, of: usize| usize::try_from(v - 1).ok().filter(|first| first + 4 <= of);
    let (width, height) = image.pixels.size();
    let (x, y) = (first(x, width)?, first(y, height)?);
    let mut sum = Colour::default();
    for (y, down) in (y..).zip(down) {
        let pixels: &[Pixel; 4] = image.pixels.row(y)[x..].first_chunk()?;
        if any_masked && image.masked.row(y)[x..x + 4].contains(&true) {
            return None;
        }
        // Weights have 14 bits and sum to less than 1.5, so a row fits in 32 bits.
        let mut row = [0; 4];
        for (pixel, across) in pixels.iter().zip(across) {
            for (row, value) in row.iter_mut().zip(pixel) {
                *row += across * i32::from(*value);
            }
        }
        for (sum, row) in sum.iter_mut().zip(row) {
            *sum += f64::from(*down) * f64::from(row);
        }
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(width: usize, height: usize) -> Image {
        let value = |x: usize, y: usize| {
            let noise = (x as u32 * 7919 + y as u32 * 104_729).wrapping_mul(0x9e37_79b9) >> 16;
            [noise as u16, (noise / 2) as u16, 9, grey(noise as u16, (noise / 2) as u16, 9)]
        };
        Image { pixels: Plane::from_fn(width, height, value), masked: Plane::filled(width, height, false) }
    }

    #[test]
    fn whole_pixels_stay_as_they_are() {
        let image = noise(20, 11);
        let same = resample(&image, (20, 11), false, |x, y| place([x as f64, y as f64])).unwrap();
        assert_eq!(same, image);
        let moved = resample(&image, (20, 11), false, |x, y| place([x as f64 + 3.0, y as f64])).unwrap();
        assert_eq!(moved.pixels[(4, 5)], image.pixels[(7, 5)]);
        assert!(moved.masked[(17, 5)] && !moved.masked[(16, 5)]);
    }

    /// The fast path agrees with the other one wherever it applies.
    #[test]
    fn the_fast_path_agrees_with_the_general_one() {
        let mut image = noise(24, 17);
        image.masked[(11, 8)] = true;
        let mut quick = 0;
        for (y, x) in (-300..4800).step_by(61).flat_map(|y| (-300..6500).step_by(53).map(move |x| (y, x))) {
            let [(column, across), (row, down)] = [x, y]
                .map(|steps: i64| (steps.div_euclid(STEPS), &WEIGHTS[steps.rem_euclid(STEPS) as usize]));
            let Some(found) = sample_inside(&image, true, [column, row], across, down) else { continue };
            quick += 1;
            let mut sum = Colour::default();
            for (j, down) in (row - 1..).zip(down) {
                for (i, across) in (column - 1..).zip(across) {
                    let pixel = image.pixels[(i as usize, j as usize)];
                    let weight = i64::from(*down) * i64::from(*across);
                    (0..4).for_each(|c| sum[c] += (weight * i64::from(pixel[c])) as f64);
                }
            }
            assert_eq!(found.map(f64::to_bits), sum.map(f64::to_bits), "{x}, {y}");
            assert_eq!(sample(&image, true, [x as i32, y as i32]), Some(found));
        }
        assert!(quick > 3000, "{quick}");
        assert_eq!(sample_inside(&image, true, [11, 8], &WEIGHTS[9], &WEIGHTS[9]), None);
    }

    #[test]
    fn a_ramp_stays_a_ramp() {
        let value = |x: usize, y: usize| (600 * x + 100 * y) as u16;
        let pixels = Plane::from_fn(30, 30, |x, y| [value(x, y); 4]);
        let image = Image { pixels, masked: Plane::filled(30, 30, false) };
        let moved =
            resample(&image, (30, 30), false, |x, y| place([x as f64 + 0.25, y as f64 - 0.5])).unwrap();
        assert_eq!(moved.pixels[(10, 10)], [value(10, 10) + 150 - 50; 4]);
        // A pixel that needs one outside is masked: three columns and rows are read beyond whole pixels.
        assert!(moved.masked[(28, 10)] && !moved.masked[(27, 10)] && moved.masked[(0, 10)]);
        assert!(moved.masked[(10, 1)] && !moved.masked[(10, 2)]);
    }

    #[test]
    fn pixels_that_need_a_masked_one_are_masked() {
        let mut image = noise(12, 12);
        image.masked[(6, 6)] = true;
        let masked = |dx: f64| {
            let moved = resample(&image, (12, 12), false, |x, y| place([x as f64 + dx, y as f64])).unwrap();
            (0..12).filter(|&x| moved.masked[(x, 6)]).collect::<Vec<_>>()
        };
        assert_eq!(masked(0.0), [6]);
        assert_eq!(masked(0.5), [0, 4, 5, 6, 7, 10, 11]);
        assert_eq!(sample(&image, true, NOWHERE), None);
        for nowhere in [[f64::NAN, 3.0], [f64::INFINITY, 3.0], [3.0, -1e300], [1e18, 1e18]] {
            // NaN becomes 0, which is inside the image; lenses never give NaN.
            let at = sample(&image, true, place(nowhere));
            assert!(nowhere[0].is_nan() || at.is_none(), "{nowhere:?}");
        }
    }

    #[test]
    fn bytes_stay_bytes() {
        let image = noise(16, 16);
        let image = Image { pixels: image.pixels.map(|p| p.map(|v| v & 0xff00)), ..image };
        assert!(image.holds_bytes() && !noise(4, 4).holds_bytes());
        let moved = resample(&image, (16, 16), true, |x, y| place([x as f64 + 0.3, y as f64 + 0.3])).unwrap();
        assert!(moved.holds_bytes());
    }
}
