//! Pairs made up on the spot for `mrfgs bench` and `cargo bench`: any size, no files, the same on every machine.
//!
//! A ground that rises towards the bottom, with boards before it, all under grain of two sizes; each view has noise of
//! its own. It is no test of accuracy: it keeps every stage as busy as a photograph does.

use mrfgs::image::{Image, Pair, Plane};
use mrfgs::options::DisparityRange;

/// A pair to be made.
#[derive(Clone, Copy)]
pub(crate) struct Synthetic {
    pub(crate) name: &'static str,
    /// In pixels.
    pub(crate) width: usize,
    /// In pixels.
    pub(crate) height: usize,
    /// Disparities are searched from 0 to one less.
    pub(crate) labels: u32,
}

/// The quarter size of the Middlebury pairs.
pub(crate) const SMALL: Synthetic = Synthetic { name: "small", width: 450, height: 375, labels: 60 };
/// The full size of those of 2014, about.
pub(crate) const LARGE: Synthetic = Synthetic { name: "large", width: 2964, height: 2000, labels: 280 };

/// Left, right, top and bottom edge of each board in 64ths of the image, and its disparity in 64ths of the range: the
/// nearest first.
const BOARDS: [[usize; 5]; 4] =
    [[34, 46, 10, 58, 56], [8, 22, 22, 60, 48], [50, 60, 4, 40, 42], [20, 40, 6, 24, 36]];

impl Synthetic {
    /// Both views.
    pub(crate) fn pair(&self) -> mrfgs::Result<Pair> {
        let &Self { width, height, labels, .. } = self;
        let most = labels as usize - 1;
        // What is seen at (x, y) by an eye that sees disparity d moved to the left by d * eye.
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

/// 32 bits that look random.
fn hash(x: usize, y: usize, salt: usize) -> u32 {
    let mut bits = (x as u32).wrapping_mul(0x9e37_79b1)
        ^ (y as u32).wrapping_mul(0x85eb_ca77)
        ^ (salt as u32).wrapping_mul(0xc2b2_ae3d);
    for _ in 0..2 {
        bits = (bits ^ bits >> 15).wrapping_mul(0x2c1b_3c6d);
    }
    bits ^ bits >> 16
}
