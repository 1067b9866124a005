//! Extends planes of measured pixels, over any distance, to filled pixels that they fit and to doubtful
//! measured ones: walls and roads continue where nothing can be matched.
//!
//! The constants are in [`patches`](crate::plan::patches). Patch (X, Y) covers the pixels (4 X, 4 Y) to
//! (4 X + 3, 4 Y + 3) inside the image. `>>` rounds down, / towards 0, and \[f\] is the sum of f over the
//! pixels of a patch. Steps 1 to 5 run twice; the second time, the planes of the first exist.
//!
//! 1. The weight w of a pixel is its [`Confidence`](crate::backend::Map::Confidence), and 0 with a flag of
//!    [`INVALID`](crate::maps::flag::INVALID). Where a plane exists, with value Q at the pixel (step 5), it is
//!
//!    ```text
//!    (Confidence max(1024 - |D - Q|, 0)) >> 10              disparity D, in 1/256 px
//!    ```
//!
//! 2. The moments of a patch: x and y are the positions of its pixels relative to its middle, in half pixels (-3, -1, 1 or 3), D' is the
//!    disparity of the first pixel with w > 0 in reading order, and e = clamp((D - D') >> 4, -`PATCH_SPREAD`, `PATCH_SPREAD`). All moments
//!    are 0 where all w are 0.
//!
//!    ```text
//!    s = [w]                                  E = [w e] / s
//!    weight    = (s + 4) >> 3
//!    place     = 512 [w x] / s, 512 [w y] / s             1/1024 px
//!    disparity = 4 D' + 64 [w e] / s                      1/1024 px
//!    xx        = ([w x x] - [w x] [w x] / s) / s          1/4 px^2; in the same way xy and yy
//!    xd        = ([w x e] - [w x] E) / (2 s)              1/16 px^2; in the same way yd
//!    dd        = ([w e e] - [w e] E) / s                  1/256 px^2
//!    ```
//!
//! 3. Moments are carried along rows, and the results along columns. With m(i) the moments of the i-th patch of a row or column:
//!
//!    ```text
//!    f(0) = m(0)           f(i) = m(i) and carried(f(i - 1))
//!    b(last) = nothing     b(i) = carried(m(i + 1) and b(i + 1))
//!    sum(i) = f(i) and b(i)
//!    ```
//!
//!    *Carried* to the next patch, the place changes by 4 px against the step, within `PATCH_REACH`, and the weight becomes
//!    (weight share) >> 8. The share is the entry of [`patch_weights`](crate::weights::patch_weights) for the difference of the two patches,
//!    or the last entry beyond it. The difference is the sum of the differences of their mean colours ([like those of half-size
//!    pixels](super::vote_fill)) plus, where both have weight of their own,
//!    max(|difference of their disparities| - `PATCH_STEP`, 0) >> `PATCH_STEP_BITS`.
//!
//!    A *and* B is A if B has no weight, and B if A has none. Otherwise, with
//!
//!    ```text
//!    r = (weight of B << 10) / weight          weight = weight of A + weight of B
//!    t = (r (1024 - r)) >> 10
//!    u, v, h = place and disparity of B minus those of A, within PATCH_AWAY and PATCH_APART
//!    ```
//!
//!    place and disparity are those of A plus (u r + 512) >> 10 and so on, and a moment is, with its values a
//!    in A and b in B, within `PATCH_MOMENT`:
//!
//!    ```text
//!    a + (((b - a) r + 512) >> 10) + ((p t + 2048) >> 12)      for dd + ((p t + 512) >> 10)
//!    p = the product of the two of u >> 8, v >> 8 and h >> 6 that the moment names
//!    ```
//! 4. A patch whose sum has a weight of at least `PATCH_LEAST` has a plane; others have none. xx and yy grow by `PATCH_RIDGE`. p is the
//!    axis with the larger of both, x on ties, and q the other axis. Slopes are in 1/8192.
//!
//!    ```text
//!    g = clamp((xy << 11) / pp, -2048, 2048)
//!    k = clamp(qd - ((g pd) >> 11), -PATCH_MOMENT, PATCH_MOMENT)
//!    slope of q = clamp((k << 11) / max(qq - ((g xy) >> 11), 1), -PATCH_STEEPEST, PATCH_STEEPEST)
//!    slope of p = clamp((pd << 11) / pp - ((g slope of q) >> 11), -PATCH_STEEPEST, PATCH_STEEPEST)
//!    value      = disparity - sum over both axes of (slope (place >> 6)) >> 7
//!    rest       = dd - sum over both axes of (2 slope (m >> 10) + ((slope (m mod 1024)) >> 9))      m = xd, yd
//!    ```
//!
//!    The plane is trusted if rest < max(`PATCH_RESIDUAL`, dd >> `PATCH_SHARE_BITS`): if the mean square
//!    residual is less than half a px^2, or an eighth of the variance.
//! 5. The value of the plane at a pixel of the patch, in 1/256 px, with x and y in half pixels as above:
//!
//!    ```text
//!    Q = (value + ((slope of x x) >> 4) + ((slope of y y) >> 4) + 2) >> 2
//!    ```
//!
//! After the second time, with the value Q of a trusted plane, clamped to the disparity range:
//!
//! - Pixels with [`FILLED`](crate::maps::flag::FILLED) take Q and keep their flags.
//! - Other valid pixels with a confidence below `PATCH_DOUBT` and |D - Q| > `PATCH_OUTVOTES` take Q too.
//!   Their flags become [`OUTVOTED`](crate::maps::flag::OUTVOTED) and `FILLED` only, and their confidence 0.
//!
//! (The confidence is the [support](super::support) of the neighbourhood, so patches of wrong matches have
//! little weight against the plane around them.)
//!
//! (Moments, unlike sums, fit in 32 bits over any distance.)

use super::{Data, Descriptor, Map, maps};
use crate::plan::patches;

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| {
        let maps = maps(&[Map::Disparity, Map::Validity, Map::Confidence]);
        [maps, vec![Data::LEFT, Data::PatchShares]].concat()
    },
    writes: |_| maps(&[Map::Disparity, Map::Validity, Map::Confidence]),
    needs: |_| vec![Data::Patches],
    taken: |plan| patches::are_taken(&plan.method),
    pixel: 14.0,
    ..Descriptor::NONE
};
