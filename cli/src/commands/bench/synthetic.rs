//! Generated pairs for `mrfgs bench` and `cargo bench`: of any size, without files, the same on every machine.
//!
//! A slanted ground plane with boards in front, textured with grain of two sizes and with separate noise per view. It keeps every stage as
//! busy as a photo does, but it is no test of accuracy.

use mrfgs::image::{Image, Pair, Plane};
use mrfgs::options::DisparityRange;

/// A pair to generate.
#[derive(Clone, Copy)]
pub(crate) struct Synthetic {
    pub(crate) name: &'static str,
    /// In pixels.
    pub(crate) width: usize,
    /// In pixels.
    pub(crate) height: usize,
    /// Disparities 0 to `labels` - 1 are searched.
    pub(crate) labels: u32,
}

/// The quarter size of Middlebury pairs.
pub(crate) const SMALL: Synthetic = Synthetic { name: "small", width: 450, height: 375, labels: 60 };
/// About the full size of the Middlebury pairs of 2014.
pub(crate) const LARGE: Synthetic = Synthetic { name: "large", width: 2964, height: 2000, labels: 280 };

/// Left, right, top and bottom edge of each board in 64ths of the image, and its disparity in 64ths of the range, nearest board first.
const BOARDS: [[usize; 5]; 4] =
    [[34, 46, 10, 58, 56], [8, 22, 22, 60, 48], [50, 60, 4, 40, 42], [20, 40, 6, 24, 36]];

impl Synthetic {
    /// Both views.
    pub(crate) fn pair(&self) -> mrfgs::Result<Pair> {
        let &Self { width, height, labels, .. } = self;
        let most = labels as usize - 1;
        // The colour at (x, y) in the view `eye` (0 left, 1 right), which sees disparity d shifted left by d * eye.
        let seen = |x: usize, y: usize, eye: usize| {
            let board = BOARDS.iter().enumerate().find(|(_, [left, right, top, bottom, d])| {
                let at = x + eye * (d * most / 64);
                (left * width / 64..right * width / 64).contains(&at)
                    && (top * height / 64..bottom * height / 64).contains(&y)
            });
            let (paint, d) = match board {
                Some((i, board)) => (i + 1, board[4] * most / 64),
                None => (0, most / 16 + y * most / (4 * height)),
            };
            let at = x + eye * d;
            let grain = [0, 8, 16].map(|bit| {
                let coarse = hash(at / 5, y / 5, paint) >> bit & 0x7f;
                let fine = hash(at, y, paint + BOARDS.len() + 1) >> bit & 0x3f;
                32 + coarse + fine
            });
            let noise = hash(x, y, 2 * BOARDS.len() + 2 + eye) & 3;
            grain.map(|value| (value + noise) as u8)
        };
        let view = |eye| Image::from_rgb8(&Plane::from_fn(width, height, |x, y| seen(x, y, eye)));
        Pair::new(view(0), view(1))
    }

    /// The disparities to search.
    pub(crate) fn range(&self) -> mrfgs::Result<DisparityRange> {
        DisparityRange::new(0, self.labels as i32 - 1)
    }
}

/// A 32-bit hash.
fn hash(x: usize, y: usize, salt: usize) -> u32 {
    let mut bits = (x as u32).wrapping_mul(0x9e37_79b1)
        ^ (y as u32).wrapping_mul(0x85eb_ca77)
        ^ (salt as u32).wrapping_mul(0xc2b2_ae3d);
    for _ in 0..2 {
        bits = (bits ^ bits >> 15).wrapping_mul(0x2c1b_3c6d);
    }
    bits ^ bits >> 16
}
