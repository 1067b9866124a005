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
    rows.for_each_init(Vec::new, |sums: &mut Vec<[u16; 4]>, (y, out)| {
        sums.clear();
        sums.resize(out.len(), [0; 4]);
        for y in side * y..height.min(side * (y + 1)) {
            let blocks = image.pixels.row(y).chunks(side).zip(image.masked.row(y).chunks(side));
            for (sum, (pixels, masked)) in sums.iter_mut().zip(blocks) {
                for (pixel, &masked) in pixels.iter().zip(masked) {
                    let seen = u16::from(!masked);
                    // The last entry counts pixels.
                    let [r, g, b, _] = pixel.map(|channel| (channel >> 8) * seen);
                    *sum = [sum[0] + r, sum[1] + g, sum[2] + b, sum[3] + seen];
                }
            }
        }
        for (out, &[r, g, b, count]) in out.iter_mut().zip(&*sums) {
            if count > 0 {
                *out = [r, g, b].map(|sum| ((2 * sum + count) / (2 * count)) as u8);
            }
        }
    });
    means
}
