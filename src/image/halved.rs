//! Pairs at half their size, which keep the full-size pair.

use super::{Image, Orientation, Pair, Pixel, Plane, View};
use crate::threads;
use crate::threads::prelude::*;
use std::sync::Arc;

impl Image {
    /// Extends the image to an even number of columns and rows by repeating the last ones.
    fn in_blocks(&self) -> Self {
        fn in_blocks<T: Copy>(plane: &Plane<T>) -> Plane<T> {
            let (width, height) = plane.size();
            let size = (width.next_multiple_of(2), height.next_multiple_of(2));
            let mut data = Vec::with_capacity(size.0 * size.1);
            for y in 0..size.1 {
                let row = plane.row(y.min(height - 1));
                data.extend_from_slice(row);
                data.extend_from_slice(&row[width - (size.0 - width)..]);
            }
            Plane::new(size.0, size.1, data)
        }
        Self { pixels: in_blocks(&self.pixels), masked: in_blocks(&self.masked) }
    }

    /// Halves the size of an image of even size: a pixel is the mean of the unmasked pixels of its 2 x 2
    /// block, rounded to the nearest value, halves up, and masked if all four are.
    pub(super) fn halved(&self) -> Self {
        let (w, h) = (self.width() / 2, self.height() / 2);
        let mut pixels = vec![[0; 4]; w * h];
        let mut masked = vec![false; w * h];
        let any_masked = self.any_masked();
        let out = pixels.par_chunks_mut(w).zip(masked.par_chunks_mut(w));
        out.enumerate().for_each(|(y, (pixels, masked))| {
            let rows = [2 * y, 2 * y + 1];
            means(rows.map(|y| self.pixels.row(y)), pixels);
            if any_masked {
                let [above, below] = rows.map(|y| self.masked.row(y).as_chunks::<2>().0.iter());
                let blocks = above.zip(below).map(|(above, below)| above[0] | above[1] | below[0] | below[1]);
                for (x, _) in blocks.enumerate().filter(|(_, any_masked)| *any_masked) {
                    (pixels[x], masked[x]) = self.mean_of_unmasked(x, y);
                }
            }
        });
        Self { pixels: Plane::new(w, h, pixels), masked: Plane::new(w, h, masked) }
    }

    /// The mean of the unmasked pixels of a block, and whether all are masked.
    fn mean_of_unmasked(&self, x: usize, y: usize) -> (Pixel, bool) {
        let places = [0, 1].map(|j| [0, 1].map(|i| (2 * x + i, 2 * y + j)));
        let (mut sums, mut count) = ([0; 4], 0);
        for &at in places.as_flattened().iter().filter(|&&at| !self.masked[at]) {
            sums.iter_mut().zip(self.pixels[at]).for_each(|(sum, v)| *sum += u32::from(v));
            count += 1;
        }
        (sums.map(|sum| ((2 * sum + count) / (2 * count).max(1)) as u16), count == 0)
    }
}

#[pulp::with_simd(means = crate::vectors::widest())]
#[inline(always)]
fn means_on<'a, S: pulp::Simd>(_: S, rows: [&'a [Pixel]; 2], out: &'a mut [Pixel]) {
    let [above, below] = rows.map(|row| row.as_chunks::<2>().0);
    for ((out, above), below) in out.iter_mut().zip(above).zip(below) {
        let four = [above[0], above[1], below[0], below[1]];
        let mut sums = [2u32; 4];
        for pixel in four {
            sums.iter_mut().zip(pixel).for_each(|(sum, v)| *sum += u32::from(v));
        }
        *out = sums.map(|sum| (sum >> 2) as u16);
    }
}

impl Pair {
    /// The pair at half its size, with this pair, extended to an even size, as its [full](Self::full) size. A
    /// pixel is the mean of a block, so disparities are halved.
    #[must_use]
    pub fn halved(&self) -> Self {
        let half = self.halved_on_use();
        half.compute();
        half
    }

    /// Like [`Self::halved`], with views that are computed on first use, which must not be in work that threads share.
    pub(crate) fn halved_on_use(&self) -> Self {
        let (width, height) = self.size();
        let full = if width % 2 + height % 2 == 0 { self.clone() } else { self.map(Image::in_blocks) };
        let [left, right] = [&full.left, &full.right].map(|view| Arc::new(View::half_of(Arc::clone(view))));
        let own_sizes = [left.size(); 2];
        Self {
            left,
            right,
            own_sizes,
            georeferences: [None, None],
            orientations: [Orientation::UPRIGHT; 2],
            doubts: full.doubts.clone(),
            full: Some(Box::new(full)),
            is_exact_half: true,
        }
    }

    /// Computes views that are [halved on use](Self::halved_on_use).
    pub(crate) fn compute(&self) {
        threads::join(|| self.left.image(), || self.right.image());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(width: usize, height: usize) -> Image {
        let pixels = Plane::from_fn(width, height, |x, y| {
            let noise = (x as u32 * 7919 + y as u32 * 104_729 + 9).wrapping_mul(0x9e37_79b9);
            [(noise >> 16) as u16, noise as u16, (noise >> 8) as u16, 0xffff]
        });
        Image { pixels, masked: Plane::filled(width, height, false) }
    }

    /// The fast path equals the general one without masked pixels; a masked pixel does not count.
    #[test]
    fn a_pixel_is_the_mean_of_its_block() {
        for (width, height) in [(36, 22), (2, 2), (2, 8), (40, 2)] {
            let image = noise(width, height);
            let quick = image.halved();
            for (x, y) in (0..height / 2).flat_map(|y| (0..width / 2).map(move |x| (x, y))) {
                assert_eq!(image.mean_of_unmasked(x, y), (quick.pixels[(x, y)], quick.masked[(x, y)]));
            }
        }
        let mut image = noise(4, 2);
        let before = image.halved();
        image.masked[(1, 1)] = true;
        (2..4).for_each(|x| (0..2).for_each(|y| image.masked[(x, y)] = true));
        let half = image.halved();
        assert_eq!(half.masked.data(), [false, true]);
        assert_ne!(half.pixels[(0, 0)], before.pixels[(0, 0)]);
        image.pixels[(1, 1)] = [1; 4];
        assert_eq!(image.halved().pixels[(0, 0)], half.pixels[(0, 0)], "a masked pixel does not count");
    }

    #[test]
    fn odd_sizes_are_extended_and_crops_include_the_full_pair() {
        let pair = Pair::new(noise(7, 5), noise(7, 5)).unwrap();
        let half = pair.halved();
        let full = half.full().unwrap();
        assert_eq!((half.size(), full.size()), ((4, 3), (8, 6)));
        assert_eq!(full.left().pixels[(7, 5)], pair.left().pixels[(6, 4)]);
        let part = half.crop(&super::super::Rect { x: 1..3, y: 1..2 });
        assert_eq!(part.full().unwrap().size(), (4, 2));
        assert_eq!(part.full().unwrap().left().pixels[(0, 0)], full.left().pixels[(2, 2)]);
        // Mirroring and halving commute.
        let mirrored = half.mirrored();
        assert_eq!(mirrored.clone().with_full(None), mirrored.full().unwrap().map(Image::halved));
    }
}
