//! Images at half their size.

use super::{Image, Plane};
use rayon::prelude::*;

impl Image {
    /// The image at half its size: a 5 x 5 binomial low-pass over the unmasked pixels, taken at every second pixel. A coarse pixel is
    /// masked when all of its up to 2 x 2 children are.
    #[must_use]
    pub fn downsampled(&self) -> Self {
        const WEIGHTS: [u32; 5] = [1, 4, 6, 4, 1];
        let (width, height) = self.pixels.size();
        let (w, h) = (width.div_ceil(2), height.div_ceil(2));
        let masked = Plane::from_fn(w, h, |x, y| {
            (2 * y..height.min(2 * y + 2))
                .all(|fy| (2 * x..width.min(2 * x + 2)).all(|fx| self.masked[(fx, fy)]))
        });
        let mut pixels = vec![[0; 4]; w * h];
        pixels.par_chunks_mut(w).enumerate().for_each_init(
            // Vertical sums of each column, and the sums of their weights.
            || vec![([0u32; 4], 0u32); width],
            |columns, (y, row)| {
                columns.fill(([0; 4], 0));
                for (j, wy) in WEIGHTS.iter().enumerate() {
                    let fy = (2 * y + j).saturating_sub(2).min(height - 1);
                    let fine = self.pixels.row(fy).iter().zip(self.masked.row(fy));
                    for ((sums, total), (pixel, &masked)) in columns.iter_mut().zip(fine) {
                        let weight = if masked { 0 } else { *wy };
                        sums.iter_mut().zip(pixel).for_each(|(sum, &v)| *sum += weight * u32::from(v));
                        *total += weight;
                    }
                }
                for (x, out) in row.iter_mut().enumerate() {
                    if masked[(x, y)] {
                        continue;
                    }
                    let (mut sums, mut total) = ([0u32; 4], 0);
                    for (i, wx) in WEIGHTS.iter().enumerate() {
                        let (column, weights) = &columns[(2 * x + i).saturating_sub(2).min(width - 1)];
                        sums.iter_mut().zip(column).for_each(|(sum, &v)| *sum += wx * v);
                        total += wx * weights;
                    }
                    *out = sums.map(|sum| ((2 * sum + total) / (2 * total)) as u16);
                }
            },
        );
        Self { pixels: Plane::new(w, h, pixels), masked }
    }
}
