//! 8-bit colours, and their means over blocks of pixels.

use crate::image::{Image, Plane};
use crate::threads::prelude::*;

/// The 8-bit channels of a pixel.
pub(super) fn channels(pixel: [u16; 4]) -> [u8; 3] {
    [0, 1, 2].map(|c| (pixel[c] >> 8) as u8)
}

/// The sum of absolute differences of the channels.
pub(super) fn difference(a: [u8; 3], b: [u8; 3]) -> usize {
    a.into_iter().zip(b).map(|(a, b)| usize::from(a.abs_diff(b))).sum()
}

/// The mean colours of the unmasked pixels in blocks of `side` x `side` inside the image; 0 if all are masked.
pub(super) fn mean_colours(image: &Image, side: usize) -> Plane<[u8; 3]> {
    let (width, height) = image.pixels.size();
    let mut means = Plane::filled(width.div_ceil(side), height.div_ceil(side), [0; 3]);
    let rows = means.data_mut().par_chunks_mut(width.div_ceil(side)).enumerate();
    rows.for_each(|(y, out)| {
        for (x, out) in out.iter_mut().enumerate() {
            let (mut sums, mut count) = ([0; 3], 0);
            for y in side * y..height.min(side * (y + 1)) {
                for x in (side * x..width.min(side * (x + 1))).filter(|&x| !image.masked[(x, y)]) {
                    let pixel = channels(image.pixels[(x, y)]);
                    sums.iter_mut().zip(pixel).for_each(|(sum, c)| *sum += u32::from(c));
                    count += 1;
                }
            }
            if count > 0 {
                *out = sums.map(|sum| ((2 * sum + count) / (2 * count)) as u8);
            }
        }
    });
    means
}
