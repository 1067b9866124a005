//! The disparity of every pixel of a pair that is matched at half its size, between its labels: the full size says which of the
//! disparities around the label fits best, and where between these.
//!
//! A pixel q = (x, y) of half the size stands for the block of the full-size pixels (2x + i, 2y + j), i and j 0 or 1. Disparities are
//! D there, and views are in whole blocks.
//!
//! 1. The census of a pixel p of a full-size view: 16 bits, one for each of [`OTHERS`], the first one the highest. A bit is set where
//!    the pixel that far from p, which is clamped to the view, is not masked and its grey is below that of p. Where p is masked or
//!    outside the view, the census is [`NO_CENSUS`], which differs from most in half of the bits.
//! 2. The cost of D at q: the number of bits in which the census of the left pixels p of the block differs from that of the right
//!    pixels p - (D, 0), summed over the block: 0 ..= 64.
//! 3. With L the label of q, of the disparity low + L (low is the smallest disparity at half the size), over those q' of its
//!    neighbourhood of 5 columns and 3 rows that are inside and whose own label is at most 1 from L:
//!
//!    ```text
//!    S(k) = sum of cost(q', 2 (low + L) + k)
//!    ```
//!
//! 4. K is the k of smallest S(k) from -[`REACH`] to [`REACH`]; on ties that of smallest |k|, and then the smaller one.
//! 5. With a = S(K - 1), b = S(K), c = S(K + 1), the offset in 1/256 px of the full size:
//!
//!    ```text
//!    s      = max(a, c) - b
//!    offset = clamp(floor((256 (a - c) + s) / (2 s)), -256, 256)       0 where s <= 0
//!    ```
//!
//! 6. [`Raw`](crate::backend::Map::Raw) and [`Disparity`](crate::backend::Map::Disparity), in 1/256 px of half the size, become
//!
//!    ```text
//!    floor((256 (2 (low + L) + K) + offset + 1) / 2)
//!    ```
//!
//! A pixel without a label has label [`NO_LABEL`](crate::backend::NO_LABEL) here; its disparity is never used.
//!
//! - The blocks of the neighbourhood together are 10 x 6 pixels, and more columns than rows for the reason of
//!   [`sub_pixel`](super::sub_pixel). With 3 x 3, bad2.0 rises from 7.9 to 8.1 % on KITTI 2015 and from 5.1 to 5.3 on ETH3D.
//! - The range does not bound the result. That would bend the planes that are laid through it; [`enlarge`](super::enlarge) does.

use super::{Data, Descriptor, Map, maps};

/// How far the disparity may be from twice that of the label, in pixels of the full size.
pub const REACH: usize = 4;
/// How far the label of a neighbour may be away.
pub const NEAR: usize = 1;
/// How many columns away a neighbour may be.
pub const COLUMNS: usize = 2;
/// Columns and rows to the pixels that a census compares: the eight around it, and those twice as far.
pub const OTHERS: [(isize, isize); 16] = [
    (-2, -2),
    (0, -2),
    (2, -2),
    (-1, -1),
    (0, -1),
    (1, -1),
    (-2, 0),
    (-1, 0),
    (1, 0),
    (2, 0),
    (-1, 1),
    (0, 1),
    (1, 1),
    (-2, 2),
    (0, 2),
    (2, 2),
];
/// The census of a pixel that there is not: every second bit.
pub const NO_CENSUS: u16 = 0xaaaa;

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| [maps(&[Map::Label]), vec![Data::FullLeft, Data::FullRight]].concat(),
    writes: |_| maps(&[Map::Raw, Map::Disparity]),
    needs: |_| vec![Data::FullLeftCensus, Data::FullRightCensus, Data::BlockCosts],
    pixel: 90.0,
    ..Descriptor::NONE
};
