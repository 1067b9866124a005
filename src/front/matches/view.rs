//! Data of a view for the search: grey values, sums over windows, and the structure tensor.

use crate::image::{Image, Plane};
use crate::threads::prelude::*;

/// The structure tensor is a sum over 5 x 5 pixels.
const TENSOR_RADIUS: usize = 2;
/// The correlation window is 7 x 7 pixels: exactly the pixels that a corner's tensor depends on, gradients
/// included. (9 x 9 gave a fifth fewer matches on five real pairs; the share of false ones rose on three and
/// fell on two.)
pub(super) const RADIUS: usize = TENSOR_RADIUS + 1;
/// Side of that window.
pub(super) const WINDOW: usize = 2 * RADIUS + 1;
/// Number of its pixels.
pub(super) const WINDOW_PIXELS: i64 = (WINDOW * WINDOW) as i64;
/// Grey is in 1/16 of an 8-bit level: the finest unit for which the sums over a window fit in 32 bits.
const GREY_SHIFT: u32 = 4;
const _: () = assert!(WINDOW_PIXELS * (0xffff >> GREY_SHIFT) * (0xffff >> GREY_SHIFT) <= i32::MAX as i64);

/// A view, and the statistics of the window around each pixel.
pub(super) struct View {
    /// In 1/16 of an 8-bit level.
    pub(super) grey: Plane<i16>,
    /// The sum over the window around each pixel.
    pub(super) sum: Plane<i32>,
    /// n sigma of the n values of each window; 0 where it is uniform, contains a masked pixel, or leaves the
    /// image.
    pub(super) norm: Plane<f64>,
}

impl View {
    pub(super) fn new(image: &Image) -> Self {
        let grey = image.pixels.map(|p| (p[3] >> GREY_SHIFT) as i16);
        let (width, height) = grey.size();
        let any_masked = image.any_masked();
        // One allocation each: freed rows of a large image may stay with the process.
        let (mut sums, mut norms) = (Plane::filled(width, height, 0), Plane::filled(width, height, 0.0));
        let rows = sums.data_mut().par_chunks_mut(width).zip(norms.data_mut().par_chunks_mut(width));
        rows.enumerate().for_each(|(y, (sums, norms))| {
            let sum = sums_of(&grey, y, |&v| i32::from(v));
            let squares = sums_of(&grey, y, |&v| i32::from(v).pow(2));
            for (norm, (sum, squares)) in norms.iter_mut().zip(sum.iter().zip(&squares)) {
                let variance = WINDOW_PIXELS * i64::from(*squares) - i64::from(*sum).pow(2);
                *norm = (variance as f64).sqrt();
            }
            if any_masked {
                let masked = sums_of(&image.masked, y, |&v| i32::from(v));
                norms
                    .iter_mut()
                    .zip(masked)
                    .filter(|(_, masked)| *masked > 0)
                    .for_each(|(norm, _)| *norm = 0.0);
            }
            sums.copy_from_slice(&sum);
        });
        Self { grey, sum: sums, norm: norms }
    }

    /// The smaller eigenvalue of the structure tensor at each pixel of row `y`; 0 where the window does not
    /// fit.
    pub(super) fn eigenvalues(&self, y: usize) -> Vec<f64> {
        let g = &self.grey;
        if y < RADIUS || y + RADIUS >= g.height() {
            return vec![0.0; g.width()];
        }
        let xx = gradient_sums(g, y, |dx, _| dx * dx);
        let xy = gradient_sums(g, y, |dx, dy| dx * dy);
        let yy = gradient_sums(g, y, |_, dy| dy * dy);
        let eigenvalue = |x: usize| {
            let [xx, xy, yy] = [&xx, &xy, &yy].map(|sums| sums[x] as f64);
            let root = ((xx - yy) * (xx - yy) + 4.0 * xy * xy).sqrt();
            if self.norm[(x, y)] > 0.0 { (xx + yy - root) / 2.0 } else { 0.0 }
        };
        (0..g.width()).map(eigenvalue).collect()
    }
}

/// Sums of `value` over the correlation windows around the pixels of row `y`; 0 where a window leaves the plane.
fn sums_of<T>(plane: &Plane<T>, y: usize, value: impl Fn(&T) -> i32) -> Vec<i32> {
    box_sums(plane.size(), y, RADIUS, |y, columns| {
        columns.iter_mut().zip(plane.row(y)).for_each(|(sum, v)| *sum += value(v));
    })
}

/// Sums of a product of gradients over the windows of the tensors of row `y`. Tensors count only where the correlation window fits,
/// so none has a gradient at either end of a row.
fn gradient_sums(grey: &Plane<i16>, y: usize, product: impl Fn(i32, i32) -> i32) -> Vec<i32> {
    box_sums(grey.size(), y, TENSOR_RADIUS, |y, columns| {
        let across = grey.row(y)[2..].iter().zip(grey.row(y));
        let down = grey.row(y + 1)[1..].iter().zip(&grey.row(y - 1)[1..]);
        for ((sum, (right, left)), (below, above)) in columns[1..].iter_mut().zip(across).zip(down) {
            *sum += product(i32::from(right - left), i32::from(below - above));
        }
    })
}

/// Sums over the squares around the pixels of row `y` of a plane, to whose columns `add` adds the values of a row; 0 where a square
/// leaves the plane.
fn box_sums(
    (width, height): (usize, usize),
    y: usize,
    radius: usize,
    add: impl Fn(usize, &mut [i32]),
) -> Vec<i32> {
    let mut out = vec![0; width];
    if y < radius || y + radius >= height || width <= 2 * radius {
        return out;
    }
    let mut columns = vec![0; width];
    (y - radius..=y + radius).for_each(|y| add(y, &mut columns));
    let mut sum: i32 = columns[..2 * radius].iter().sum();
    for x in radius..width - radius {
        sum += columns[x + radius];
        out[x] = sum;
        sum -= columns[x - radius];
    }
    out
}
