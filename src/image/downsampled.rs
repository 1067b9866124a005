//! Downsamples images to half their size.

use super::{Image, Pixel, Plane};
use crate::threads;
use crate::threads::prelude::*;
use bytemuck::cast_slice;

/// The weights of the low-pass, in both directions.
const WEIGHTS: [u32; 5] = [1, 4, 6, 4, 1];

impl Image {
    /// The image at half its size: a 5 x 5 binomial low-pass over the unmasked pixels, taken at every second pixel. A coarse pixel is
    /// masked when all of its up to 2 x 2 children are.
    #[must_use]
    pub fn downsampled(&self) -> Self {
        let (width, height) = self.pixels.size();
        let (w, h) = (width.div_ceil(2), height.div_ceil(2));
        let any_masked = self.any_masked();
        let masked = if any_masked { self.masked_children() } else { Plane::filled(w, h, false) };
        let mut pixels = vec![[0; 4]; w * h];
        let rows = pixels.par_chunks_mut(w).enumerate();
        let of_row = |room: &mut Vec<[u32; 4]>, (y, row): (usize, &mut [Pixel])| {
            let rows = [0, 1, 2, 3, 4].map(|j| (2 * y + j).saturating_sub(2).min(height - 1));
            if any_masked {
                self.low_pass_masked(rows, masked.row(y), row);
            } else {
                low_pass(rows.map(|y| cast_slice(self.pixels.row(y))), room, row);
            }
        };
        threads::run(|| rows.for_each_init(Vec::new, of_row));
        Self { pixels: Plane::new(w, h, pixels), masked }
    }

    fn masked_children(&self) -> Plane<bool> {
        let (width, height) = self.pixels.size();
        Plane::from_fn(width.div_ceil(2), height.div_ceil(2), |x, y| {
            (2 * y..height.min(2 * y + 2))
                .all(|fy| (2 * x..width.min(2 * x + 2)).all(|fx| self.masked[(fx, fy)]))
        })
    }

    /// Computes a row of the result from these `rows`, without masked pixels.
    fn low_pass_masked(&self, rows: [usize; 5], masked: &[bool], out: &mut [Pixel]) {
        let width = self.pixels.width();
        // Vertical sums of each column, and the sums of their weights.
        let mut columns = vec![([0u32; 4], 0u32); width];
        for (fy, wy) in rows.into_iter().zip(WEIGHTS) {
            let fine = self.pixels.row(fy).iter().zip(self.masked.row(fy));
            for ((sums, total), (pixel, &masked)) in columns.iter_mut().zip(fine) {
                let weight = if masked { 0 } else { wy };
                sums.iter_mut().zip(pixel).for_each(|(sum, &v)| *sum += weight * u32::from(v));
                *total += weight;
            }
        }
        for (x, (out, _)) in out.iter_mut().zip(masked).enumerate().filter(|(_, (_, masked))| !**masked) {
            let (mut sums, mut total) = ([0u32; 4], 0);
            for (i, wx) in WEIGHTS.into_iter().enumerate() {
                let (column, weights) = &columns[(2 * x + i).saturating_sub(2).min(width - 1)];
                sums.iter_mut().zip(column).for_each(|(sum, &v)| *sum += wx * v);
                total += wx * weights;
            }
            *out = sums.map(|sum| ((2 * sum + total) / (2 * total)) as u16);
        }
    }
}

/// Like `low_pass_masked`, without masked pixels; `room` is scratch memory.
#[pulp::with_simd(low_pass = crate::vectors::widest())]
#[inline(always)]
fn low_pass_on<'a, S: pulp::Simd>(
    _: S,
    rows: [&'a [u16]; 5],
    room: &'a mut Vec<[u32; 4]>,
    out: &'a mut [Pixel],
) {
    let width = rows[0].len() / 4;
    // Vertical sums of each column, with two more columns at either end that repeat the last.
    room.resize(width + 4, [0; 4]);
    let sums = &mut bytemuck::cast_slice_mut::<_, u32>(room)[8..8 + 4 * width];
    let [above, over, here, under, below] = rows.map(|row| &row[..4 * width]);
    for (i, sum) in sums.iter_mut().enumerate() {
        let [a, b, c, d, e] = [above[i], over[i], here[i], under[i], below[i]].map(u32::from);
        *sum = a + e + 4 * (b + d) + 6 * c;
    }
    let (first, last) = (room[2], room[width + 1]);
    room[..2].fill(first);
    room[width + 2..].fill(last);
    for (x, out) in out.iter_mut().enumerate() {
        let around: &[[u32; 4]; 5] = room[2 * x..].first_chunk().expect("five columns around each pixel");
        let mut sum = [128; 4];
        for (column, weight) in around.iter().zip(WEIGHTS) {
            sum.iter_mut().zip(column).for_each(|(sum, &v)| *sum += weight * v);
        }
        *out = sum.map(|sum| (sum >> 8) as u16);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without masked pixels, the fast path gives the same result as the other one.
    #[test]
    fn the_fast_path_agrees_with_the_masked_one() {
        for (width, height) in [(37, 22), (2, 2), (1, 9), (8, 1), (5, 3)] {
            let noise =
                |x: usize, y: usize| (x as u32 * 7919 + y as u32 * 104_729 + 9).wrapping_mul(0x9e37_79b9);
            let pixels = Plane::from_fn(width, height, |x, y| {
                let noise = noise(x, y);
                [(noise >> 16) as u16, noise as u16, (noise >> 8) as u16, 0xffff]
            });
            let image = Image { pixels, masked: Plane::filled(width, height, false) };
            let quick = image.downsampled();
            for y in 0..quick.height() {
                let rows = [0, 1, 2, 3, 4].map(|j| (2 * y + j).saturating_sub(2).min(height - 1));
                let mut row = vec![[0; 4]; quick.width()];
                image.low_pass_masked(rows, quick.masked.row(y), &mut row);
                assert_eq!(row, quick.pixels.row(y), "row {y} of {width} x {height}");
            }
        }
    }
}
