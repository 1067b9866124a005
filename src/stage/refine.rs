//! Refines the disparity of every pixel of a pair matched at half its size: costs at full size select the
//! best disparity around the label, to a fraction of a pixel.
//!
//! A half-size pixel q = (x, y) covers the block of the full-size pixels (2x + i, 2y + j), i and j 0 or 1. D
//! are full-size disparities; views are in whole blocks.
//!
//! 1. The census of a pixel p of a full-size view has 16 bits, one for each of [`OTHERS`], the first one the highest. A bit is set if
//!    the pixel at this offset from p, clamped to the view, is not masked and its grey is below that of p. If p is masked or outside
//!    the view, the census is [`NO_CENSUS`], which differs from most in half of the bits.
//! 2. The cost of D at q: the Hamming distance between the census of the left pixels p of the block and that
//!    of the right pixels p - (D, 0), summed over the block: 0 ..= 64.
//! 3. With L the label of q, of disparity low + L (low is the smallest disparity at half the size), over the
//!    q' of the neighbourhood of 5 columns and 3 rows that are inside and whose label is at most 1 from L:
//!
//!    ```text
//!    S(k) = sum of cost(q', 2 (low + L) + k)
//!    ```
//!
//! 4. K is the k of smallest S(k) from -[`REACH`] to [`REACH`]; on ties the one of smallest |k|, then the smaller one.
//! 5. With a = S(K - 1), b = S(K), c = S(K + 1), the offset in 1/256 px at full size:
//!
//!    ```text
//!    s      = max(a, c) - b
//!    offset = clamp(floor((256 (a - c) + s) / (2 s)), -256, 256)       0 where s <= 0
//!    ```
//!
//! 6. [`Raw`](crate::backend::Map::Raw) and [`Disparity`](crate::backend::Map::Disparity), in 1/256 px at half the size, become
//!
//!    ```text
//!    floor((256 (2 (low + L) + K) + offset + 1) / 2)
//!    ```
//!
//! A pixel without a label has the label [`NO_LABEL`](crate::backend::NO_LABEL); its disparity is never used.
//!
//! - The blocks of the neighbourhood together are 10 x 6 pixels, wider than high for the reason given in
//!   [`sub_pixel`](super::sub_pixel). With 3 x 3, bad2.0 rises from 7.9 to 8.1 % on KITTI 2015 and from 5.1
//!   to 5.3 on ETH3D.
//! - The result is not clamped to the range, which would bend the planes fitted to it;
//!   [`enlarge`](super::enlarge) clamps.

use super::{Data, Descriptor, Map, maps};

/// Largest distance of the disparity from twice that of the label, in full-size pixels.
pub(crate) const REACH: usize = 4;
/// Largest difference of the label of a neighbour.
pub(crate) const NEAR: usize = 1;
/// Largest horizontal distance of a neighbour.
pub(crate) const COLUMNS: usize = 2;
/// Offsets (x, y) of the pixels that a census compares: the eight neighbours, and others at distance 2.
pub(crate) const OTHERS: [(isize, isize); 16] = [
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
/// The census of a masked or outside pixel: every second bit.
pub(crate) const NO_CENSUS: u16 = 0xaaaa;

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| [maps(&[Map::Label]), vec![Data::FullLeft, Data::FullRight]].concat(),
    writes: |_| maps(&[Map::Raw, Map::Disparity]),
    needs: |_| vec![Data::FullLeftCensus, Data::FullRightCensus, Data::BlockCosts],
    pixel: 60.0,
    ..Descriptor::NONE
};
