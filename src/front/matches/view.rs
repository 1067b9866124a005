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
/// Rows whose sums slide down from one to the next; a thread takes so many at once.
const BAND: usize = 32;
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
        let bands =
            sums.data_mut().par_chunks_mut(BAND * width).zip(norms.data_mut().par_chunks_mut(BAND * width));
        bands.enumerate().for_each(|(band, (sums, norms))| {
            let new = || BoxSums::new(width, RADIUS);
            let (mut values, mut squares, mut masked) = (new(), new(), new());
            let mut of_squares = vec![0; width];
            let mut of_masked = vec![0; width];
            let rows = sums.chunks_mut(width).zip(norms.chunks_mut(width));
            for (y, (sum, norm)) in (BAND * band..).zip(rows) {
                if !fits(y, RADIUS, height) {
                    continue;
                }
                values.slide_to(y, |y, out| fill(out, grey.row(y), |v| i32::from(*v)));
                squares.slide_to(y, |y, out| fill(out, grey.row(y), |v| i32::from(*v).pow(2)));
                values.sums(sum);
                squares.sums(&mut of_squares);
                for (norm, (sum, squares)) in norm.iter_mut().zip(sum.iter().zip(&of_squares)) {
                    // Exact, since nothing reaches 2^53.
                    let (sum, squares) = (f64::from(*sum), f64::from(*squares));
                    *norm = (WINDOW_PIXELS as f64 * squares - sum * sum).sqrt();
                }
                if any_masked {
                    masked.slide_to(y, |y, out| fill(out, image.masked.row(y), |v| i32::from(*v)));
                    masked.sums(&mut of_masked);
                    let hidden = norm.iter_mut().zip(&of_masked).filter(|(_, masked)| **masked > 0);
                    hidden.for_each(|(norm, _)| *norm = 0.0);
                }
            }
        });
        Self { grey, sum: sums, norm: norms }
    }

    /// The smaller eigenvalue of the structure tensor at each pixel; 0 where the correlation window does not fit.
    pub(super) fn eigenvalues(&self) -> Plane<f64> {
        let g = &self.grey;
        let (width, height) = g.size();
        let mut values = Plane::filled(width, height, 0.0);
        values.data_mut().par_chunks_mut(BAND * width).enumerate().for_each(|(band, values)| {
            let mut tensors = [(); 3].map(|()| BoxSums::new(width, TENSOR_RADIUS));
            let mut sums = [(); 3].map(|()| vec![0; width]);
            for (y, row) in (BAND * band..).zip(values.chunks_mut(width)) {
                if !fits(y, RADIUS, height) || width < WINDOW {
                    continue;
                }
                let [xx, xy, yy] = &mut tensors;
                xx.slide_to(y, |y, out| gradients(g, y, out, |dx, _| dx * dx));
                xy.slide_to(y, |y, out| gradients(g, y, out, |dx, dy| dx * dy));
                yy.slide_to(y, |y, out| gradients(g, y, out, |_, dy| dy * dy));
                tensors.iter().zip(&mut sums).for_each(|(tensor, sums)| tensor.sums(sums));
                let [xx, xy, yy] = &sums;
                let tensors = xx.iter().zip(xy).zip(yy);
                for ((value, norm), ((xx, xy), yy)) in row.iter_mut().zip(self.norm.row(y)).zip(tensors) {
                    let [xx, xy, yy] = [xx, xy, yy].map(|sum| f64::from(*sum));
                    let root = ((xx - yy) * (xx - yy) + 4.0 * xy * xy).sqrt();
                    *value = if *norm > 0.0 { (xx + yy - root) / 2.0 } else { 0.0 };
                }
            }
        });
        values
    }
}

/// Whether the squares of this radius around the pixels of row `y` are among the rows of the plane.
fn fits(y: usize, radius: usize, height: usize) -> bool {
    y >= radius && y + radius < height
}

fn fill<T>(out: &mut [i32], row: &[T], value: impl Fn(&T) -> i32) {
    out.iter_mut().zip(row).for_each(|(out, v)| *out = value(v));
}

/// Products of the gradients of row `y`, except at its ends: tensors count only where the correlation window fits, so none has these.
fn gradients(grey: &Plane<i16>, y: usize, out: &mut [i32], product: impl Fn(i32, i32) -> i32) {
    let across = grey.row(y)[2..].iter().zip(grey.row(y));
    let down = grey.row(y + 1)[1..].iter().zip(&grey.row(y - 1)[1..]);
    for ((out, (right, left)), (below, above)) in out[1..].iter_mut().zip(across).zip(down) {
        *out = product(i32::from(right - left), i32::from(below - above));
    }
}

/// Sums of values over the squares around the pixels of a row, which slide down from row to row.
struct BoxSums {
    radius: usize,
    /// The values of the rows of the squares, each at its number modulo their count.
    rows: Vec<Vec<i32>>,
    /// The sum of these rows.
    columns: Vec<i32>,
    /// The row after the last of them; `None` before the first.
    next: Option<usize>,
}

impl BoxSums {
    fn new(width: usize, radius: usize) -> Self {
        let rows = vec![vec![0; width]; 2 * radius + 1];
        Self { radius, rows, columns: vec![0; width], next: None }
    }

    /// Moves the squares to row `y`, below the last one; `fill` writes the values of a row.
    fn slide_to(&mut self, y: usize, fill: impl Fn(usize, &mut [i32])) {
        for y in self.next.unwrap_or(y - self.radius)..=y + self.radius {
            let place = y % self.rows.len();
            let row = &mut self.rows[place];
            self.columns.iter_mut().zip(&*row).for_each(|(sum, v)| *sum -= v);
            fill(y, row);
            self.columns.iter_mut().zip(&*row).for_each(|(sum, v)| *sum += v);
        }
        self.next = Some(y + self.radius + 1);
    }

    /// Writes the sums of the row; those of squares that leave the plane stay as they are.
    fn sums(&self, out: &mut [i32]) {
        let side = 2 * self.radius + 1;
        let Some(inside) = out.len().checked_sub(side - 1) else { return };
        let out = &mut out[self.radius..][..inside];
        out.copy_from_slice(&self.columns[..inside]);
        for i in 1..side {
            out.iter_mut().zip(&self.columns[i..]).for_each(|(sum, v)| *sum += v);
        }
    }
}
