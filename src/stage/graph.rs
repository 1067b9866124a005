//! The graph of a level: each dependency factor joins a pixel with the neighbours that most likely lie on the
//! same surface, judged by distance in space and colour.
//!
//! 1. The guide of level 0 is the left image; the guide of a coarser level is the guide of the next finer one
//!    [at half its size](crate::image::Image::downsampled). A coarse pixel (x, y) is masked, with channels 0,
//!    if all of its children (2 x, 2 y) to (2 x + 1, 2 y + 1) inside the image are masked. Otherwise, in each
//!    channel, over the unmasked ones of the 5 x 5 places (2 x + i, 2 y + j), clamped to the image:
//!
//!    ```text
//!    s = sum of B(i) B(j) fine(2 x + i, 2 y + j)         B = 1 4 6 4 1 at -2 ..= 2
//!    n = sum of B(i) B(j)
//!    guide(x, y) = floor((2 s + n) / (2 n))              to the nearest, ties up
//!    ```
//!
//! 2. Each pixel p has one factor. Candidates for its neighbours are the pixels q = p + (dx, dy) other than p
//!    with |dx| and |dy| at most 3 (a window of [`GRAPH_WINDOW`](crate::plan::GRAPH_WINDOW)), inside and
//!    unmasked; a masked p has none. They are ordered by their distance, then by dx^2 + dy^2, then in reading
//!    order, with c(p) a channel of the guide:
//!
//!    ```text
//!    distance(q) = sum over c = r, g, b of (|c(p) - c(q)| >> 6)^2  +  S (dx^2 + dy^2)
//!    S           = min(round((1020 sigma_range / sigma_space)^2), 2^20)
//!    ```
//!
//! 3. Slot 0 of the factor holds p. The next [`neighbours`](crate::plan::Plan::neighbours) slots hold the
//!    first candidates in this order, by their [`code`](crate::graph::code). Remaining slots are empty:
//!    [`NO_MEMBER`](crate::graph::NO_MEMBER).
//!
//! The paper takes the pixels whose bilateral coefficient reaches a percentile:
//!
//! ```text
//! exp(-(dx^2 + dy^2) / (2 sigma_space^2) - |colour difference|^2 / (2 sigma_range^2))
//! ```
//!
//! Only the order of the coefficients matters, so their exponents are compared, in integers: the graph is the
//! same on every machine. `>> 6` gives quarters of an 8-bit step; intensities from 0 to 1 have 1020. The
//! coefficient of the centre is always the largest, so the percentile is taken over the 48 others, which the
//! paper leaves open: ceil(48 (100 - percentile) / 100) neighbours.

use super::{Data, Descriptor};

pub(super) const ROW: Descriptor = Descriptor {
    // A coarse guide is computed from the next finer one.
    reads: |z| vec![Data::Guide(z.saturating_sub(1))],
    writes: |z| {
        [vec![Data::Members(z), Data::Incoming(z)], Vec::from_iter((z > 0).then_some(Data::Guide(z)))]
            .concat()
    },
    needs: |z| vec![Data::NextGuide(z)],
    joins: true,
    pixel: 28.0,
    ..Descriptor::NONE
};
