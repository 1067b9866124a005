//! Extends planes over any distance: see [`crate::backend::Stage::FarPlane`].

use super::plane::limits;
use crate::backend::cpu::colours::{difference, mean_colours};
use crate::image::{Pair, Plane};
use crate::maps::{flag, is_filled};
use crate::plan::Plan;
use crate::plan::patches::{
    PATCH, PATCH_APART, PATCH_AWAY, PATCH_DOUBT, PATCH_FAR_BITS, PATCH_LEAST, PATCH_MOMENT, PATCH_OUTVOTES,
    PATCH_REACH, PATCH_RESIDUAL, PATCH_RIDGE, PATCH_ROUNDS, PATCH_SHARE_BITS, PATCH_SPREAD, PATCH_STEEPEST,
    PATCH_STEP, PATCH_STEP_BITS, PATCH_WEIGHT_BITS, patches,
};
use crate::stage::{MapSet, Stage};
use crate::threads::prelude::*;
use crate::weights::patch_weights;

pub(super) fn run(maps: &mut MapSet, plan: &Plan, pair: &Pair) {
    if !Stage::FarPlane.is_taken(plan) {
        return;
    }
    let size = patches(plan);
    let mut fits = Plane::filled(size.0, size.1, None);
    let colours = mean_colours(pair.left(), PATCH);
    let shares = patch_weights();
    for _ in 0..PATCH_ROUNDS {
        let own = by_patch(size, |x, y| own(maps, (x, y), fits[(x, y)].as_ref()));
        fits = fit(&own, &colours, &shares);
    }
    let (low, high) = limits(plan);
    let MapSet { disparity, validity, confidence, .. } = maps;
    let width = disparity.width();
    let rows = disparity.data_mut().par_chunks_mut(width).zip(validity.data_mut().par_chunks_mut(width));
    let rows = rows.zip(confidence.data_mut().par_chunks_mut(width)).enumerate();
    rows.for_each(|(y, ((disparity, flags), confidence))| {
        for (x, ((out, flags), confidence)) in disparity.iter_mut().zip(flags).zip(confidence).enumerate() {
            let Some(fit) = fits[(x / PATCH, y / PATCH)].filter(|fit| fit.trusted) else { continue };
            let value = fit.at(x % PATCH, y % PATCH).clamp(low, high);
            let in_doubt = *flags & flag::INVALID == 0 && u32::from(*confidence) < PATCH_DOUBT;
            if is_filled(*flags) {
                *out = value;
            } else if in_doubt && (value - *out).abs() > PATCH_OUTVOTES {
                (*out, *flags, *confidence) = (value, flag::OUTVOTED | flag::FILLED, 0);
            }
        }
    });
}

/// Computes `of` for each patch.
fn by_patch<T: Copy + Default + Send>(
    (width, height): (usize, usize),
    of: impl Fn(usize, usize) -> T + Sync,
) -> Plane<T> {
    let mut out = Plane::filled(width, height, T::default());
    out.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        row.iter_mut().enumerate().for_each(|(x, out)| *out = of(x, y));
    });
    out
}

/// Weighted moments of measured pixels.
#[derive(Clone, Copy, Default)]
struct Moments {
    weight: u32,
    /// Mean position, relative to the middle of a patch.
    mean: [i32; 2],
    disparity: i32,
    xx: i32,
    xy: i32,
    yy: i32,
    xd: i32,
    yd: i32,
    dd: i32,
}

/// The moments of the pixels of a patch; those far from the plane `fit` count less.
fn own(maps: &MapSet, (x, y): (usize, usize), fit: Option<&Fit>) -> Moments {
    let MapSet { disparity, validity, confidence, .. } = maps;
    let (width, height) = disparity.size();
    let (mut first, mut s) = (None, 0i32);
    let [mut sx, mut sy, mut se] = [0i32; 3];
    let [mut sxx, mut sxy, mut syy, mut sxe, mut sye, mut see] = [0i32; 6];
    for v in PATCH * y..height.min(PATCH * (y + 1)) {
        for u in PATCH * x..width.min(PATCH * (x + 1)) {
            let (d, mut w) = (disparity[(u, v)], i32::from(confidence[(u, v)]));
            if validity[(u, v)] & flag::INVALID != 0 {
                continue;
            }
            if let Some(fit) = fit {
                let near = (1 << PATCH_FAR_BITS) - (d - fit.at(u % PATCH, v % PATCH)).abs();
                w = (w * near.max(0)) >> PATCH_FAR_BITS;
            }
            if w == 0 {
                continue;
            }
            let e = ((d - *first.get_or_insert(d)) >> 4).clamp(-PATCH_SPREAD, PATCH_SPREAD);
            let [x, y] = [u, v].map(from_middle);
            s += w;
            (sx, sy, se) = (sx + w * x, sy + w * y, se + w * e);
            (sxx, sxy, syy) = (sxx + w * x * x, sxy + w * x * y, syy + w * y * y);
            (sxe, sye, see) = (sxe + w * x * e, sye + w * y * e, see + w * e * e);
        }
    }
    let Some(first) = first else { return Moments::default() };
    let e = se / s;
    Moments {
        weight: (s as u32 + (1 << PATCH_WEIGHT_BITS >> 1)) >> PATCH_WEIGHT_BITS,
        mean: [512 * sx / s, 512 * sy / s],
        disparity: 4 * first + 64 * se / s,
        xx: (sxx - sx * sx / s) / s,
        xy: (sxy - sx * sy / s) / s,
        yy: (syy - sy * sy / s) / s,
        xd: (sxe - sx * e) / (2 * s),
        yd: (sye - sy * e) / (2 * s),
        dd: (see - se * e) / s,
    }
}

/// Distance of a column or row from the middle of its patch, in half pixels.
fn from_middle(at: usize) -> i32 {
    2 * (at % PATCH) as i32 - (PATCH as i32 - 1)
}

impl Moments {
    /// The moments relative to the next patch along an axis, with `share` / 256 of their weight.
    #[inline(always)]
    fn carried(mut self, axis: usize, forward: bool, share: u32) -> Self {
        let step = 1024 * PATCH as i32;
        let mean = &mut self.mean[axis];
        *mean = (*mean + if forward { -step } else { step }).clamp(-PATCH_REACH, PATCH_REACH);
        self.weight = (self.weight * share) >> 8;
        self
    }

    /// Merges two sets of moments.
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        if other.weight == 0 {
            return self;
        }
        if self.weight == 0 {
            return other;
        }
        let weight = self.weight + other.weight;
        let share = ((other.weight << 10) / weight) as i32;
        let both = (share * (1024 - share)) >> 10;
        let toward = |a: i32, by: i32| a + ((by * share + 512) >> 10);
        let apart = |a: i32, b: i32, most: i32| (b - a).clamp(-most, most);
        let dx = apart(self.mean[0], other.mean[0], PATCH_AWAY);
        let dy = apart(self.mean[1], other.mean[1], PATCH_AWAY);
        let dd = apart(self.disparity, other.disparity, PATCH_APART);
        let (x, y, d) = (dx >> 8, dy >> 8, dd >> 6);
        let moment = |a: i32, b: i32, product: i32, bits: u32| {
            let between = (product * both + (1 << bits >> 1)) >> bits;
            (toward(a, b - a) + between).clamp(-PATCH_MOMENT, PATCH_MOMENT)
        };
        Self {
            weight,
            mean: [toward(self.mean[0], dx), toward(self.mean[1], dy)],
            disparity: toward(self.disparity, dd),
            xx: moment(self.xx, other.xx, x * x, 12),
            xy: moment(self.xy, other.xy, x * y, 12),
            yy: moment(self.yy, other.yy, y * y, 12),
            xd: moment(self.xd, other.xd, x * d, 12),
            yd: moment(self.yd, other.yd, y * d, 12),
            dd: moment(self.dd, other.dd, d * d, 10),
        }
    }

    /// The plane through the moments, if their weight suffices.
    fn fit(&self) -> Option<Fit> {
        if self.weight < PATCH_LEAST {
            return None;
        }
        let (xx, yy) = (self.xx + PATCH_RIDGE, self.yy + PATCH_RIDGE);
        let (a, b) = if xx >= yy {
            slopes(xx, self.xy, yy, self.xd, self.yd)
        } else {
            let (b, a) = slopes(yy, self.xy, xx, self.yd, self.xd);
            (a, b)
        };
        let along = |slope: i32, mean: i32| (slope * (mean >> 6)) >> 7;
        let left = self.dd - product(a, self.xd) - product(b, self.yd);
        Some(Fit {
            trusted: left < PATCH_RESIDUAL.max(self.dd >> PATCH_SHARE_BITS),
            value: self.disparity - along(a, self.mean[0]) - along(b, self.mean[1]),
            slopes: [a, b],
        })
    }
}

/// (slope along the axis p with the larger moment, slope along the other axis q), in 1/8192.
fn slopes(pp: i32, pq: i32, qq: i32, pd: i32, qd: i32) -> (i32, i32) {
    let tilt = ((pq << 11) / pp).clamp(-2048, 2048);
    let q = (qq - ((tilt * pq) >> 11)).max(1);
    let rest = (qd - ((tilt * pd) >> 11)).clamp(-PATCH_MOMENT, PATCH_MOMENT);
    let of_q = ((rest << 11) / q).clamp(-PATCH_STEEPEST, PATCH_STEEPEST);
    let of_p = ((pd << 11) / pp - ((tilt * of_q) >> 11)).clamp(-PATCH_STEEPEST, PATCH_STEEPEST);
    (of_p, of_q)
}

/// A slope times a moment, in 1/256 px^2. (The product itself does not fit in 32 bits.)
fn product(slope: i32, moment: i32) -> i32 {
    2 * slope * (moment >> 10) + ((slope * (moment & 1023)) >> 9)
}

/// A plane through the measured pixels.
#[derive(Clone, Copy)]
struct Fit {
    /// Whether filled and doubtful pixels take its value.
    trusted: bool,
    /// Value in the middle of the patch, in 1/1024 px.
    value: i32,
    slopes: [i32; 2],
}

impl Fit {
    /// The value at a pixel of the patch, in 1/256 px.
    #[inline(always)]
    fn at(&self, x: usize, y: usize) -> i32 {
        let [a, b] = self.slopes;
        (self.value + ((a * from_middle(x)) >> 4) + ((b * from_middle(y)) >> 4) + 2) >> 2
    }
}

/// The planes through the patches' own moments and those that reach them.
fn fit(own: &Plane<Moments>, colours: &Plane<[u8; 3]>, shares: &[u32]) -> Plane<Option<Fit>> {
    let (width, height) = own.size();
    let share = |a: (usize, usize), b: (usize, usize)| {
        let (one, other) = (&own[a], &own[b]);
        let mut apart = difference(colours[a], colours[b]);
        if one.weight > 0 && other.weight > 0 {
            let step = (one.disparity - other.disparity).abs() - PATCH_STEP;
            apart += (step.max(0) >> PATCH_STEP_BITS) as usize;
        }
        shares[apart.min(shares.len() - 1)]
    };
    let mut rows = own.clone();
    rows.data_mut().par_chunks_mut(width).enumerate().for_each_init(Vec::new, |back, (y, row)| {
        carry(row, 0, |x| share((x - 1, y), (x, y)), back);
    });
    // Transposed: column by column.
    let mut fits = Plane::filled(height, width, None);
    let columns = fits.data_mut().par_chunks_mut(height).enumerate();
    columns.for_each_init(Default::default, |(column, back): &mut (Vec<_>, _), (x, out)| {
        column.clear();
        column.extend((0..height).map(|y| rows[(x, y)]));
        carry(column, 1, |y| share((x, y - 1), (x, y)), back);
        out.iter_mut().zip(column).for_each(|(out, sum)| *out = sum.fit());
    });
    by_patch((width, height), |x, y| fits[(y, x)])
}

/// Sums moments along a line; `share(i)` is the remaining weight after the step to place i from the one
/// before. `back` is scratch memory.
fn carry(line: &mut [Moments], axis: usize, share: impl Fn(usize) -> u32, back: &mut Vec<Moments>) {
    back.clear();
    back.resize(line.len(), Moments::default());
    for i in (1..line.len()).rev() {
        back[i - 1] = line[i].and(back[i]).carried(axis, false, share(i));
    }
    for i in 1..line.len() {
        line[i] = line[i].and(line[i - 1].carried(axis, true, share(i)));
    }
    line.iter_mut().zip(back).for_each(|(sum, back)| *sum = sum.and(*back));
}
