//! Extends planes over any distance: see [`crate::backend::Stage::FarPlane`].

use super::plane::limits;
use crate::backend::cpu::colours::{difference, mean_colours};
use crate::backend::cpu::least_squares::Divisor;
use crate::backend::cpu::units::each_lane;
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
use std::array::from_fn;

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

/// Weighted moments of measured pixels: of one patch, or of patches in several lines, in [`Lanes`].
#[derive(Clone, Copy, Default)]
struct Moments<T = i32> {
    weight: T,
    /// Mean position, relative to the middle of a patch.
    mean: [T; 2],
    disparity: T,
    xx: T,
    xy: T,
    yy: T,
    xd: T,
    yd: T,
    dd: T,
}

/// The moments of the pixels of a patch; those far from the plane `fit` count less.
fn own(maps: &MapSet, (x, y): (usize, usize), fit: Option<&Fit>) -> Moments {
    let MapSet { disparity, validity, confidence, .. } = maps;
    let (width, height) = disparity.size();
    let (mut first, mut s) = (None, 0i32);
    let [mut sx, mut sy, mut se] = [0i32; 3];
    let [mut sxx, mut sxy, mut syy, mut sxe, mut sye, mut see] = [0i32; 6];
    let columns = PATCH * x..width.min(PATCH * (x + 1));
    for v in PATCH * y..height.min(PATCH * (y + 1)) {
        let pixels = disparity.row(v)[columns.clone()].iter().zip(&confidence.row(v)[columns.clone()]);
        let pixels = pixels.zip(&validity.row(v)[columns.clone()]).zip(columns.clone());
        for (((&d, &confidence), &flags), u) in pixels {
            if flags & flag::INVALID != 0 {
                continue;
            }
            let mut w = i32::from(confidence);
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
        weight: (s + (1 << PATCH_WEIGHT_BITS >> 1)) >> PATCH_WEIGHT_BITS,
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

/// Number of lines of patches that are summed together, in the lanes of vectors.
const LINES: usize = 8;

/// One number per line.
type Lanes = [i32; LINES];

impl Moments<Lanes> {
    /// The moments of these patches.
    #[inline(always)]
    fn of(patches: &[Moments; LINES]) -> Self {
        let all = |of: fn(&Moments) -> i32| each_lane(|i| of(&patches[i]));
        Self {
            weight: all(|patch| patch.weight),
            mean: [all(|patch| patch.mean[0]), all(|patch| patch.mean[1])],
            disparity: all(|patch| patch.disparity),
            xx: all(|patch| patch.xx),
            xy: all(|patch| patch.xy),
            yy: all(|patch| patch.yy),
            xd: all(|patch| patch.xd),
            yd: all(|patch| patch.yd),
            dd: all(|patch| patch.dd),
        }
    }

    /// The moments in one line.
    #[inline(always)]
    fn in_line(&self, i: usize) -> Moments {
        Moments {
            weight: self.weight[i],
            mean: [self.mean[0][i], self.mean[1][i]],
            disparity: self.disparity[i],
            xx: self.xx[i],
            xy: self.xy[i],
            yy: self.yy[i],
            xd: self.xd[i],
            yd: self.yd[i],
            dd: self.dd[i],
        }
    }

    /// The moments relative to the next patch along an axis, with `shares` / 256 of their weight.
    #[inline(always)]
    fn carried(mut self, axis: usize, forward: bool, shares: &Lanes) -> Self {
        let step = if forward { -1024 * PATCH as i32 } else { 1024 * PATCH as i32 };
        let mean = self.mean[axis];
        self.mean[axis] = each_lane(|i| (mean[i] + step).clamp(-PATCH_REACH, PATCH_REACH));
        self.weight = each_lane(|i| (self.weight[i] * shares[i]) >> 8);
        self
    }

    /// Merges two sets of moments. Where one of them has no weight, it takes the other: what is computed there may overflow.
    #[inline(always)]
    fn and(&self, other: &Self) -> Self {
        let weight: Lanes = each_lane(|i| self.weight[i] + other.weight[i]);
        let share: Lanes = each_lane(|i| Divisor::new(weight[i].max(1)).divide(other.weight[i] << 10));
        let both: Lanes = each_lane(|i| (share[i] * (1024 - share[i])) >> 10);
        let chosen = |i: usize, a: i32, b: i32, merged: i32| {
            let of_one = if self.weight[i] == 0 { b } else { merged };
            if other.weight[i] == 0 { a } else { of_one }
        };
        let toward =
            |i: usize, a: i32, by: i32| a.wrapping_add((by.wrapping_mul(share[i]).wrapping_add(512)) >> 10);
        let apart =
            |a: &Lanes, b: &Lanes, most: i32| -> Lanes { each_lane(|i| (b[i] - a[i]).clamp(-most, most)) };
        let dx = apart(&self.mean[0], &other.mean[0], PATCH_AWAY);
        let dy = apart(&self.mean[1], &other.mean[1], PATCH_AWAY);
        let dd = apart(&self.disparity, &other.disparity, PATCH_APART);
        let mean = |a: &Lanes, b: &Lanes, apart: &Lanes| -> Lanes {
            each_lane(|i| chosen(i, a[i], b[i], toward(i, a[i], apart[i])))
        };
        let (x, y): (Lanes, Lanes) = (each_lane(|i| dx[i] >> 8), each_lane(|i| dy[i] >> 8));
        let d: Lanes = each_lane(|i| dd[i] >> 6);
        let moment = |a: &Lanes, b: &Lanes, of: (&Lanes, &Lanes), bits: u32| -> Lanes {
            each_lane(|i| {
                let between = (of.0[i] * of.1[i] * both[i] + (1 << bits >> 1)) >> bits;
                let merged = toward(i, a[i], b[i] - a[i]).wrapping_add(between);
                chosen(i, a[i], b[i], merged.clamp(-PATCH_MOMENT, PATCH_MOMENT))
            })
        };
        Self {
            weight,
            mean: [mean(&self.mean[0], &other.mean[0], &dx), mean(&self.mean[1], &other.mean[1], &dy)],
            disparity: mean(&self.disparity, &other.disparity, &dd),
            xx: moment(&self.xx, &other.xx, (&x, &x), 12),
            xy: moment(&self.xy, &other.xy, (&x, &y), 12),
            yy: moment(&self.yy, &other.yy, (&y, &y), 12),
            xd: moment(&self.xd, &other.xd, (&x, &d), 12),
            yd: moment(&self.yd, &other.yd, (&y, &d), 12),
            dd: moment(&self.dd, &other.dd, (&d, &d), 10),
        }
    }
}

impl Moments {
    /// The plane through the moments, if their weight suffices.
    fn fit(&self) -> Option<Fit> {
        if self.weight < PATCH_LEAST.cast_signed() {
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
        shares[apart.min(shares.len() - 1)] as i32
    };
    let mut rows = own.clone();
    rows.data_mut().par_chunks_mut(LINES * width).enumerate().for_each_init(
        Lines::default,
        |lines, (i, rows)| {
            let in_rows = |line: usize| (LINES * i + line).min(height - 1);
            lines.load(
                width,
                |line, x| own[(x, in_rows(line))],
                |line, x| share((x - 1, in_rows(line)), (x, in_rows(line))),
            );
            carry(lines, 0);
            for (line, row) in rows.chunks_mut(width).enumerate() {
                row.iter_mut().zip(&lines.sums).for_each(|(out, sums)| *out = sums.in_line(line));
            }
        },
    );
    // Transposed: column by column.
    let mut fits = Plane::filled(height, width, None);
    let columns = fits.data_mut().par_chunks_mut(LINES * height).enumerate();
    columns.for_each_init(Lines::default, |lines, (i, columns)| {
        let in_columns = |line: usize| (LINES * i + line).min(width - 1);
        lines.load(
            height,
            |line, y| rows[(in_columns(line), y)],
            |line, y| share((in_columns(line), y - 1), (in_columns(line), y)),
        );
        carry(lines, 1);
        for (line, column) in columns.chunks_mut(height).enumerate() {
            column.iter_mut().zip(&lines.sums).for_each(|(out, sums)| *out = sums.in_line(line).fit());
        }
    });
    by_patch((width, height), |x, y| fits[(y, x)])
}

/// [`LINES`] lines of patches, and scratch memory.
#[derive(Default)]
struct Lines {
    sums: Vec<Moments<Lanes>>,
    /// The weight that remains after the step to each place from the one before, in 1/256.
    shares: Vec<Lanes>,
    back: Vec<Moments<Lanes>>,
}

impl Lines {
    /// Takes the moments `of` each line and place, and the share of the step to it, of lines of this `length`.
    #[inline(always)]
    fn load(
        &mut self,
        length: usize,
        of: impl Fn(usize, usize) -> Moments,
        share: impl Fn(usize, usize) -> i32,
    ) {
        self.sums.clear();
        self.sums.extend((0..length).map(|at| Moments::<Lanes>::of(&from_fn(|line| of(line, at)))));
        self.shares.clear();
        self.shares.push(Lanes::default());
        self.shares.extend((1..length).map(|at| -> Lanes { from_fn(|line| share(line, at)) }));
    }
}

/// Sums the moments along the lines, which are along `axis`.
#[pulp::with_simd(carry = crate::vectors::widest())]
#[inline(always)]
fn carry_on<S: pulp::Simd>(_: S, lines: &mut Lines, axis: usize) {
    let Lines { sums, shares, back } = lines;
    back.clear();
    back.resize(sums.len(), Moments::default());
    for i in (1..sums.len()).rev() {
        back[i - 1] = sums[i].and(&back[i]).carried(axis, false, &shares[i]);
    }
    for i in 1..sums.len() {
        sums[i] = sums[i].and(&sums[i - 1].carried(axis, true, &shares[i]));
    }
    sums.iter_mut().zip(back).for_each(|(sum, back)| *sum = sum.and(back));
}
