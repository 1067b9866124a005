//! The matching cost of level 0: how unlike the left pixel (x, y) and the right pixel (x - d, y)
//! are, for the disparity d of each label, 0 ..= [`COST_MAX`](crate::plan::COST_MAX).
//!
//! Where x - d is outside the image or either pixel is masked, the cost is
//! [`outside_cost`](crate::plan::Plan::outside_cost). Elsewhere, as
//! [`MatchingCost`](crate::options::MatchingCost) says, with channels and grey as
//! [`Pixel`](crate::image::Pixel) holds them (`>> 8` makes them 8-bit), and dr, dg and db the
//! differences of the channels between left and right:
//!
//! - **SAD**, over the places (i, j) of a square of side `sad_window` around the pixel at which
//!   left (x + i, y + j) and right (x - d + i, y + j) are both inside and unmasked:
//!
//!   ```text
//!   n    = the number of these places
//!   S    = sum of |dr| + |dg| + |db| over them
//!   cost = min(floor((S + 384 n) / (768 n)), COST_MAX)         the mean in 8 bits, ties up
//!   ```
//!
//! - **Census**. The census of a pixel has a bit for each other place of its 9 x 7 neighbourhood,
//!   clamped to the image: set where the place is unmasked and its grey is below the centre's.
//!
//!   ```text
//!   h    = the number of bits in which the two censuses differ
//!   cost = 4 min(h, 40)
//!   ```
//!
//! - **AD-census** adds the difference in colour, with a weight w that grows with the contrast of
//!   the left image. g is the grey `>> 8` of each of the 63 clamped places of the 9 x 7
//!   neighbourhood of left (x, y), that of the centre where the place is masked; t is
//!   [`colour_variance`](crate::plan::Plan::colour_variance).
//!
//!   ```text
//!   A    = min(|dr| + |dg| + |db|, 64)                         of channels >> 8
//!   v    = 63 (sum of g^2) - (sum of g)^2                      63^2 times the variance
//!   w    = floor(48 min(v, t) / t)                             48 where t = 0
//!   cost = 4 min(h, 40) + ((w A + 32) >> 6)
//!   ```

use super::{Descriptor, Volume, volumes};

pub(super) const ROW: Descriptor =
    Descriptor { writes: |_| volumes(&[Volume::Cost(0)]), cell: 0.7, ..Descriptor::NONE };
