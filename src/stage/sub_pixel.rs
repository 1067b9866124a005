//! The disparity of every pixel of level 0 between the labels: at the tip of a symmetric V through
//! the matching costs around its label, the steeper side setting the slope of both.
//!
//! 1. With cost(q, k) the level's cost of label k at pixel q, and L the label of the pixel, of
//!    disparity low + L (low is the smallest disparity), over those q of its neighbourhood of 5
//!    columns and 3 rows that are inside and whose own label is at most 2 from L:
//!
//!    ```text
//!    a = sum of cost(q, L - 1)      b = sum of cost(q, L)      c = sum of cost(q, L + 1)
//!    ```
//!
//! 2. The offset, in 1/256 px:
//!
//!    ```text
//!    s      = max(a, c) - b
//!    offset = clamp(floor((256 (a - c) + s) / (2 s)), -256, 256)
//!    ```
//!
//!    It is 0 where s <= 0, where L is the first or the last label of the level or
//!    [`NO_LABEL`](crate::backend::NO_LABEL), and where
//!    [`sub_pixel`](crate::options::RefinementOptions::sub_pixel) is off.
//! 3. [`Raw`](crate::backend::Map::Raw) and [`Disparity`](crate::backend::Map::Disparity) become
//!    256 (low + L) + offset.
//!
//! - The cost and not the belief: the truncation of the messages flattens the belief beside its
//!   optimum and draws a fit to whole labels.
//! - Up to a whole label: beside a step between labels, messages often leave a pixel on the wrong
//!   side of it.
//! - More columns than rows: on the ground, disparities differ from row to row.

use super::{Descriptor, Map, Volume, maps, volumes};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| [volumes(&[Volume::Cost(0)]), maps(&[Map::Label])].concat(),
    writes: |_| maps(&[Map::Raw, Map::Disparity]),
    reach: Some(1),
    pixel: 40.0,
    ..Descriptor::NONE
};
