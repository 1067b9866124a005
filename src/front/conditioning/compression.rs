//! Compression: JPEG divides an image into blocks of 8 x 8 pixels, with higher steps between them at lower quality.

use crate::image::{Image, Pair};
use crate::threads::prelude::*;
use std::array::from_fn;

/// Pairs of a step ratio and a standard deviation in pixels: if the steps between blocks are at least this many
/// times as high as elsewhere, both views are smoothed by that (open). Of 49 real pairs none reaches 1.05, of
/// the rendered scenes none 1.13. Of eight pairs, qualities of 75, 50, 20 and 5 give 1.12 to 1.31, 1.27 to
/// 1.53, 1.55 to 2.1 and 2.4 to 4.6; at each of these, the standard deviation here is the best or next to it.
const SMOOTHING: [(f64, f64); 4] = [(2.3, 1.6), (1.55, 1.0), (1.25, 0.7), (1.15, 0.5)];
/// Side of a block, in pixels.
const BLOCK: usize = 8;
/// Steps are limited to this many 8-bit levels, so that contours of the scene do not decide.
const MAX_STEP: u16 = 20;

/// The standard deviation by which to smooth both views; 0 if at least one of them has no blocks.
pub(super) fn smoothing(pair: &Pair) -> f64 {
    let steps = f64::min(steps(pair.left()), steps(pair.right()));
    SMOOTHING.iter().find(|(least, _)| steps >= *least).map_or(0.0, |(_, sigma)| *sigma)
}

/// The mean step of grey between blocks, relative to that between other pixels; 1 if there is none. Blocks
/// may begin anywhere, since an image may be cropped.
fn steps(image: &Image) -> f64 {
    let (width, height) = image.pixels.size();
    let any_masked = image.any_masked();
    let masked = |y: usize| any_masked.then(|| image.masked.row(y));
    let rows: Vec<[Steps; 2]> = (0..height)
        .into_par_iter()
        .map_init(
            || [vec![0; width], vec![0; width]],
            |[grey, above], y| {
                let read = |y: usize, grey: &mut [u16]| {
                    grey.iter_mut().zip(image.pixels.row(y)).for_each(|(grey, pixel)| *grey = pixel[3]);
                };
                read(y, grey);
                let (mut across, mut down) = (Steps::default(), Steps::default());
                across.add_row(
                    &grey[1..],
                    &grey[..width - 1],
                    masked(y).map(|masked| [&masked[1..], masked]),
                );
                if y > 0 {
                    read(y - 1, above);
                    down.add_row(grey, above, masked(y).zip(masked(y - 1)).map(<[_; 2]>::from));
                }
                [across, down.all_at(y)]
            },
        )
        .collect();
    let [across, down] = [0, 1].map(|way| rows.iter().fold(Steps::default(), |all, row| all.and(&row[way])));
    let [(between, within), (also_between, also_within)] = [across, down].map(|steps| steps.means());
    let (between, within) = (between + also_between, within + also_within);
    if within > 0.0 { between / within } else { 1.0 }
}

/// Sums and numbers of steps, by position in a block.
#[derive(Clone, Copy, Default)]
struct Steps {
    sums: [u64; BLOCK],
    counts: [u64; BLOCK],
}

impl Steps {
    /// Adds the steps between `others` and `row`, except those of masked pixels.
    fn add_row(&mut self, row: &[u16], others: &[u16], masked: Option<[&[bool]; 2]>) {
        if let Some([masked, others_masked]) = masked {
            let pixels = row.iter().zip(others).zip(masked.iter().zip(others_masked)).enumerate();
            for (i, ((a, b), _)) in pixels.filter(|(_, (_, (a, b)))| !**a && !**b) {
                self.sums[i % BLOCK] += u64::from(step(*a, *b));
                self.counts[i % BLOCK] += 1;
            }
            return;
        }
        // The sums of so many steps fit in 32 bits.
        for (row, others) in row.chunks(BLOCK << 16).zip(others.chunks(BLOCK << 16)) {
            let mut sums = [0_u32; BLOCK];
            let ((row, rest), (others, others_rest)) =
                (row.as_chunks::<BLOCK>(), others.as_chunks::<BLOCK>());
            for (row, others) in row.iter().zip(others) {
                for (sum, (a, b)) in sums.iter_mut().zip(row.iter().zip(others)) {
                    *sum += u32::from(step(*a, *b));
                }
            }
            for (sum, (a, b)) in sums.iter_mut().zip(rest.iter().zip(others_rest)) {
                *sum += u32::from(step(*a, *b));
            }
            for (i, sum) in sums.into_iter().enumerate() {
                self.sums[i] += u64::from(sum);
                self.counts[i] += (row.len() + usize::from(i < rest.len())) as u64;
            }
        }
    }

    /// All steps counted at one `place`.
    fn all_at(&self, place: usize) -> Self {
        let mut all = Self::default();
        (all.sums[place % BLOCK], all.counts[place % BLOCK]) =
            (self.sums.iter().sum(), self.counts.iter().sum());
        all
    }

    fn and(&self, other: &Self) -> Self {
        Self {
            sums: from_fn(|i| self.sums[i] + other.sums[i]),
            counts: from_fn(|i| self.counts[i] + other.counts[i]),
        }
    }

    /// The largest mean of any place, and the average of all others.
    fn means(&self) -> (f64, f64) {
        let means: [f64; BLOCK] = from_fn(|i| self.sums[i] as f64 / self.counts[i].max(1) as f64);
        let largest = means.into_iter().fold(0.0, f64::max);
        (largest, (means.iter().sum::<f64>() - largest) / (BLOCK - 1) as f64)
    }
}

/// The step between two values of grey, in 1/256 of a level.
fn step(a: u16, b: u16) -> u16 {
    a.abs_diff(b).min(MAX_STEP << 8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Plane;

    /// A slope in blocks of this side, each of one grey, that begin at this offset.
    fn blocks(side: usize, begin: usize) -> Image {
        let grey =
            |x: usize, y: usize| (64 * ((x + side - begin) / side + (y + side - begin) / side) % 256) as u8;
        Image::from_rgb8(&Plane::from_fn(64, 48, |x, y| {
            let noise = (x as u32 * 73 + y as u32 * 179 + 1).wrapping_mul(0x9e37_79b9) >> 30;
            [grey(x, y) / 2 + noise as u8; 3]
        }))
    }

    #[test]
    fn blocks_of_eight_pixels_are_found_wherever_they_begin() {
        for begin in [0, 3] {
            let found = steps(&blocks(8, begin));
            assert!(found > 4.0, "{found}");
        }
        // Controls: blocks of another size, and none.
        for side in [7, 9, 1] {
            let found = steps(&blocks(side, 0));
            assert!(found < 2.5, "{found} in blocks of {side}");
        }
        assert_eq!(steps(&Image::from_rgb8(&Plane::filled(3, 2, [7; 3]))).to_bits(), 1.0_f64.to_bits());
    }

    #[test]
    fn masked_pixels_do_not_count() {
        let mut image = blocks(1, 0);
        let before = steps(&image);
        for x in (0..64).step_by(8) {
            for y in 0..48 {
                image.pixels[(x, y)] = [0xffff; 4];
                image.masked[(x, y)] = true;
            }
        }
        assert!((steps(&image) - before).abs() < 0.5);
    }
}
