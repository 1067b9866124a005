//! The disparity of every pixel of level 0 between the labels: the tip of a symmetric V through the matching
//! costs around its label; the steeper side sets the slope of both.
//!
//! 1. With cost(q, k) the level's cost of label k at pixel q, and L the label of the pixel, of disparity
//!    low + L (low is the smallest disparity), over the q of the neighbourhood of 5 columns and 3 rows that
//!    are inside and whose label is at most 2 from L:
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
//!    It is 0 if s <= 0, if L is the first or last label of the level, and if
//!    [`sub_pixel`](crate::options::RefinementOptions::sub_pixel) is off. A pixel with
//!    [`NO_LABEL`](crate::backend::NO_LABEL) counts as one with the last label, but not in the neighbourhood of others.
//! 3. [`Raw`](crate::backend::Map::Raw) and [`Disparity`](crate::backend::Map::Disparity) become
//!    256 (low + L) + offset.
//!
//! - It uses costs, because truncation of messages flattens the belief beside its optimum, which biases a fit
//!   to whole labels.
//! - The offset may reach a whole label, because messages often leave a pixel on the wrong side of a step
//!   between labels.
//! - It uses more columns than rows, because on the ground disparities differ from row to row.

use super::{Descriptor, Map, Volume, maps, volumes};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| [volumes(&[Volume::Cost(0)]), maps(&[Map::Label])].concat(),
    writes: |_| maps(&[Map::Raw, Map::Disparity]),
    reach: Some(1),
    pixel: 40.0,
    ..Descriptor::NONE
};
