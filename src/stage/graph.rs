//! The graph of a level: each dependency factor joins a pixel with those neighbours that are most
//! likely on the same surface, being near it in place and in colour.
//!
//! 1. The guide of level 0 is the left image, and that of a coarser level the guide of the next
//!    finer one [at half its size](crate::image::Image::downsampled). A coarse pixel (x, y) is
//!    masked, and its channels are 0, where all of its children (2 x, 2 y) to (2 x + 1, 2 y + 1)
//!    that are inside are masked. Otherwise, in each channel, over those of the 5 x 5 places
//!    (2 x + i, 2 y + j), clamped to the image, that are not masked:
//!
//!    ```text
//!    s = sum of B(i) B(j) fine(2 x + i, 2 y + j)         B = 1 4 6 4 1 at -2 ..= 2
//!    n = sum of B(i) B(j)
//!    guide(x, y) = floor((2 s + n) / (2 n))              to the nearest, ties up
//!    ```
//!
//! 2. Each pixel p has one factor. Candidates for its neighbours are the pixels q = p + (dx, dy)
//!    other than p with |dx| and |dy| at most 3 ([`GRAPH_WINDOW`](crate::plan::GRAPH_WINDOW) a
//!    side), inside and unmasked; a masked p has none. With c(p) a channel of the guide, they are
//!    ordered by their distance, then by dx^2 + dy^2, then in reading order:
//!
//!    ```text
//!    distance(q) = sum over c = r, g, b of (|c(p) - c(q)| >> 6)^2  +  S (dx^2 + dy^2)
//!    S           = min(round((1020 sigma_range / sigma_space)^2), 2^20)
//!    ```
//!
//! 3. Slot 0 of the factor holds p. The slots behind it,
//!    [`neighbours`](crate::plan::Plan::neighbours) in number, hold the first candidates in this
//!    order, by their [`code`](crate::graph::code). Slots left over are empty:
//!    [`NO_MEMBER`](crate::graph::NO_MEMBER).
//!
//! The paper takes the pixels whose bilateral coefficient reaches a percentile:
//!
//! ```text
//! exp(-(dx^2 + dy^2) / (2 sigma_space^2) - |colour difference|^2 / (2 sigma_range^2))
//! ```
//!
//! Only the order of the coefficients matters, so their exponents are compared, in integers: every
//! machine picks the same graph. `>> 6` makes quarters of an 8-bit step, of which intensities from
//! 0 to 1 have 1020. The centre's own coefficient is always the largest, so the percentile is taken
//! over the 48 others, which the paper leaves open: ceil(48 (100 - percentile) / 100) neighbours.

use super::{Data, Descriptor};

pub(super) const ROW: Descriptor = Descriptor {
    // The guide of a level is that of the next finer one at half its size.
    reads: |z| vec![Data::Guide(z.saturating_sub(1))],
    writes: |z| {
        [vec![Data::Members(z), Data::Incoming(z)], Vec::from_iter((z > 0).then_some(Data::Guide(z)))]
            .concat()
    },
    needs: |z| vec![Data::NextGuide(z)],
    joins: true,
    pixel: 34.0,
    ..Descriptor::NONE
};
