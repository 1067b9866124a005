//! Gives filled pixels a disparity by the votes of valid pixels around them, and replaces doubtful
//! disparities that are outvoted. It does nothing unless [`fill`](crate::options::RefinementOptions::fill) is
//! [`Votes`](crate::options::Fill::Votes).
//!
//! The constants are in [`votes`](crate::plan::votes). Pixels without a flag of
//! [`INVALID`](crate::maps::flag::INVALID) are valid; valid pixels with a confidence of at least `VOTE_SURE`
//! are sure. Half-size pixel (X, Y) covers the pixels (2 X, 2 Y) to (2 X + 1, 2 Y + 1) inside the image.
//! Votes are costs: the smallest sum wins. All steps read the maps from before the stage.
//!
//! 1. Colour of a half-size pixel, in each channel c, over its n unmasked pixels; 0 if n = 0. The difference
//!    of two colours is the sum of the absolute differences of r, g and b.
//!
//!    ```text
//!    C(X, Y) = floor((2 s + n) / (2 n)),  s = sum of c >> 8
//!    ```
//!
//! 2. Votes of a half-size pixel on each even label k = 0, 2, 4, ..., of disparity low + k (low is the
//!    smallest disparity):
//!
//!    ```text
//!    v(k) = 2^VOTE_FRACTION_BITS (sum of these over its pixels)
//!           min(|D - 256 (low + k)|, VOTE_MOST) >> VOTE_BITS      valid pixel of disparity D, in 1/256 px
//!           VOTE_HIDING if k hides a label in the right view      neither valid nor masked
//!           0                                                     otherwise
//!    ```
//!
//!    A sure pixel (x, y) of label j shows j in the right view at x - low - j of the row, if that is inside;
//!    of several j there, the right view sees the nearest. Label k of pixel (x, y) hides it if the right view
//!    sees some j at x - low - k and k is nearer than j by at least `HIDING_LABELS`. Nearer labels are larger
//!    or smaller ones, depending on [`nearer`](crate::options::RefinementOptions::nearer).
//! 3. Sums along each row. w(X) is the weight of the step between X - 1 and X: the first entry of
//!    [`vote_weights`](crate::weights::vote_weights) for their difference in colour. Products precede `>>`.
//!
//!    ```text
//!    f(X) = v(X) + (w(X) f(X - 1) >> 16)                    f(0) = v(0)
//!    b(X) = w(X + 1) (v(X + 1) + b(X + 1)) >> 16            0 at the last X
//!    r(X) = (f(X) + b(X)) >> VOTE_SHIFT
//!    ```
//!
//! 4. Sums along each column. w(Y', Y' + 1) is the weight of the step between these rows: the second entry of
//!    `vote_weights`:
//!
//!    ```text
//!    s(Y)  = r(Y) + above + below
//!    above = 0, then w(Y', Y' + 1) (r(Y') + above) >> 16    for Y' = Y - VOTE_REACH, ..., Y - 1
//!    below = 0, then w(Y' - 1, Y') (r(Y') + below) >> 16    for Y' = Y + VOTE_REACH, ..., Y + 1
//!    ```
//!
//!    Rows outside the image are omitted.
//! 5. The vote is for the label k of smallest s(k), the lowest on ties; there is none if s is the same for
//!    all labels. Its disparity V, in 1/256 px:
//!
//!    ```text
//!    p = s(k - 2) - s(k),  q = s(k + 2) - s(k)              both halved, rounded down, as often
//!    t = max(p, q)                                          as brings both below 65536
//!    V = 256 (low + k) + floor((512 (p - q) + t) / (2 t))
//!    ```
//!
//!    If t = 0, or k is the first or last even label, V = 256 (low + k).
//! 6. A filled pixel (x, y) takes the V of one of the 3 x 3 half-size pixels (X, Y) around (x >> 1, y >> 1)
//!    that are inside and have a vote: the least unlike one, the first in reading order on ties. If there is
//!    none, it keeps its disparity. Its flags stay.
//!
//!    ```text
//!    unlike(X, Y) = difference of c(x, y) >> 8 and C(X, Y)
//!                   + VOTE_AWAY (|X - (x >> 1)| + |Y - (y >> 1)|)
//!    ```
//!
//! 7. A valid pixel that is not sure is outvoted if half-size pixel (x >> 1, y >> 1) has a vote with
//!    |V - D| > `VOTE_OUTVOTES`. It takes this V, its flags become [`OUTVOTED`](crate::maps::flag::OUTVOTED) and
//!    [`FILLED`](crate::maps::flag::FILLED) only, and its confidence 0.

use super::{Data, Descriptor, Map, maps};
use crate::plan::votes;

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| {
        let maps = maps(&[Map::Label, Map::Disparity, Map::Validity, Map::Confidence]);
        [maps, vec![Data::LEFT, Data::VoteWeights]].concat()
    },
    writes: |_| maps(&[Map::Disparity, Map::Validity, Map::Confidence]),
    needs: |_| vec![Data::Shown, Data::HalfColours, Data::Elected, Data::Sums, Data::Totals],
    taken: |plan| votes::are_taken(&plan.method),
    pixel: 60.0,
    ..Descriptor::NONE
};
