//! Matching cost of level 0: see [`crate::backend::Stage::Cost`].

use super::units::{Blocks, Units, block, block_mut, each_lane};
use super::volumes::Volumes;
use crate::image::{Image, Pair, Pixel};
use crate::options::MatchingCost;
use crate::plan::{
    CENSUS_BIT_COST, CENSUS_BITS, CENSUS_PLACES, CENSUS_RADIUS_X, CENSUS_RADIUS_Y, COLOUR_MOST, COST_MAX,
    Plan,
};
use rayon::prelude::*;

const CENSUS_X: usize = CENSUS_RADIUS_X as usize;
const CENSUS_Y: isize = CENSUS_RADIUS_Y as isize;

pub(super) fn run<U: Units>(v: &mut Volumes<U>) {
    let Volumes { plan, pair, fine_cost: out, .. } = v;
    match plan.method.cost.matching {
        MatchingCost::Census | MatchingCost::AdCensus => census(plan, pair, out),
        MatchingCost::Sad => sad(plan, pair, out),
    }
}

fn difference(a: Pixel, b: Pixel) -> u32 {
    (0..3).map(|c| u32::from(a[c].abs_diff(b[c]))).sum()
}

fn census(plan: &Plan, pair: &Pair, out: &mut [u8]) {
    let level = &plan.levels[0];
    let width = level.width;
    // The right image is read from right to left, so that ascending labels are side by side.
    let [left, right] = [Greys::new(pair.left(), false), Greys::new(pair.right(), true)];
    out.par_chunks_mut(width * level.stride).enumerate().for_each_init(
        || (Row::new(width, level.stride), Row::new(width, level.stride), Contrast::new(width)),
        |(here, there, contrast), (y, row)| {
            fill_row(here, pair.left(), &left, y);
            fill_row(there, pair.right(), &right, y);
            colour_weights(plan, &left, y, contrast);
            cost_row(plan, here, there, &contrast.weights, row);
        },
    );
}

/// The costs of a row.
#[pulp::with_simd(cost_row = pulp::Arch::new())]
#[inline(always)]
fn cost_row_on<'a, S: pulp::Simd>(
    _: S,
    plan: &'a Plan,
    here: &'a Row,
    there: &'a Row,
    weights: &'a [u16],
    row: &'a mut [u8],
) {
    let level = &plan.levels[0];
    let width = level.width;
    let any_masked = there.masked.iter().any(|&masked| masked != 0);
    for (x, costs) in row.chunks_exact_mut(level.stride).enumerate() {
        // The right pixel of label index j is at `place` + j from the right.
        let place = (width - 1 - x) as i64 + i64::from(level.min);
        let first = (-place).max(0);
        let end = (width as i64 - place).min(level.labels as i64);
        if here.masked[here.margin + x] != 0 || first >= end {
            costs[..level.labels].fill(plan.outside_cost);
            costs[level.labels..].fill(u8::MAX);
            continue;
        }
        let place = (here.margin as i64 + place) as usize;
        PixelCosts { here, there, at: here.margin + x, place, weight: weights[x], costs }.all(level.stride);
        let (first, end) = (first as usize, end as usize);
        if any_masked {
            let masked = &there.masked[place + first..];
            for (cost, &masked) in costs[first..end].iter_mut().zip(masked) {
                *cost = if masked == 0 { *cost } else { plan.outside_cost };
            }
        }
        costs[..first].fill(plan.outside_cost);
        costs[end..level.labels].fill(plan.outside_cost);
        costs[level.labels..].fill(u8::MAX);
    }
}

/// The costs of a left pixel against every pixel of the right row.
struct PixelCosts<'a> {
    here: &'a Row,
    there: &'a Row,
    /// Position of the pixel in its row, and of the pixel of label index 0 in the other row.
    at: usize,
    place: usize,
    weight: u16,
    costs: &'a mut [u8],
}

impl Blocks for PixelCosts<'_> {
    #[inline(always)]
    fn block<const N: usize>(&mut self, label: usize) {
        let mut bits = [0u8; N];
        for (here, there) in self.here.census.iter().zip(&self.there.census) {
            let (here, there) = (here[self.at], block::<u8, N>(there, self.place + label));
            bits = each_lane(|i| bits[i] + (here ^ there[i]).count_ones() as u8);
        }
        let mut costs: [u8; N] = each_lane(|i| CENSUS_BIT_COST as u8 * bits[i].min(CENSUS_BITS as u8));
        if self.weight > 0 {
            let mut apart = [0u8; N];
            for (here, there) in self.here.channels.iter().zip(&self.there.channels) {
                let (here, there) = (here[self.at], block::<u8, N>(there, self.place + label));
                apart = each_lane(|i| apart[i].saturating_add(here.abs_diff(there[i])));
            }
            let weighted: [u16; N] = each_lane(|i| self.weight * u16::from(apart[i].min(COLOUR_MOST as u8)));
            costs =
                each_lane(|i| costs[i] + ((weighted[i] + COLOUR_MOST as u16 / 2) / COLOUR_MOST as u16) as u8);
        }
        *block_mut(self.costs, label) = costs;
    }
}

/// The grey of an image, its columns continued beyond the border as far as a census reaches.
struct Greys {
    size: (usize, usize),
    mirrored: bool,
    /// Row by row, with [`CENSUS_X`] more columns on either side.
    values: Vec<u16>,
    /// 0, or the largest value where masked; `None` where no pixel is masked.
    masked: Option<Vec<u16>>,
}

impl Greys {
    fn new(image: &Image, mirrored: bool) -> Self {
        let size @ (width, height) = image.pixels.size();
        let pitch = width + 2 * CENSUS_X;
        let padded = |value: &(dyn Fn(usize, usize) -> u16 + Sync)| {
            let mut out = vec![0; pitch * height];
            out.par_chunks_mut(pitch).enumerate().for_each(|(y, row)| {
                for (i, out) in row.iter_mut().enumerate() {
                    let x = i.saturating_sub(CENSUS_X).min(width - 1);
                    *out = value(if mirrored { width - 1 - x } else { x }, y);
                }
            });
            out
        };
        let any = image.masked.data().iter().any(|&masked| masked);
        Self {
            size,
            mirrored,
            values: padded(&|x, y| image.pixels[(x, y)][3]),
            masked: any.then(|| padded(&|x, y| if image.masked[(x, y)] { u16::MAX } else { 0 })),
        }
    }

    /// Calls `see` for every offset (dx, dy) of the window around the pixels of row `y`, with the greys at
    /// that offset for all of them, and which of these are masked. A whole row at a time is processed with
    /// vectors.
    #[inline(always)]
    fn around(&self, y: usize, mut see: impl FnMut(isize, isize, &[u16], Option<&[u16]>)) {
        let (width, height) = self.size;
        for dy in -CENSUS_Y..=CENSUS_Y {
            let ny = (y as isize + dy).clamp(0, height as isize - 1) as usize;
            for i in 0..=2 * CENSUS_X {
                // In the order of the original image, mirrored or not.
                let column = if self.mirrored { 2 * CENSUS_X - i } else { i };
                let there = ny * (width + 2 * CENSUS_X) + column..;
                let masked = self.masked.as_ref().map(|masked| &masked[there.clone()][..width]);
                see(i as isize - CENSUS_X as isize, dy, &self.values[there][..width], masked);
            }
        }
    }

    /// The greys of row `y` itself.
    fn row(&self, y: usize) -> &[u16] {
        let (width, _) = self.size;
        &self.values[y * (width + 2 * CENSUS_X) + CENSUS_X..][..width]
    }
}

/// A row of an image as the costs need it, with as many extra pixels at either end as there are labels.
struct Row {
    margin: usize,
    /// Eight bits of the census per plane.
    census: [Vec<u8>; 8],
    /// 8-bit levels.
    channels: [Vec<u8>; 3],
    /// 1 where masked, else 0.
    masked: Vec<u8>,
}

impl Row {
    fn new(width: usize, margin: usize) -> Self {
        let row = || vec![0; width + 2 * margin];
        Self { margin, census: [(); 8].map(|()| row()), channels: [(); 3].map(|()| row()), masked: row() }
    }
}

/// Fills a row with row `y` of an image.
#[pulp::with_simd(fill_row = pulp::Arch::new())]
#[inline(always)]
fn fill_row_on<'a, S: pulp::Simd>(_: S, row: &'a mut Row, image: &'a Image, greys: &'a Greys, y: usize) {
    let centre = greys.row(y);
    let inside = row.margin..row.margin + centre.len();
    let mut place = 0;
    greys.around(y, |dx, dy, others, masked| {
        if (dx, dy) == (0, 0) {
            return;
        }
        let plane = &mut row.census[place / 8][inside.clone()];
        let fresh = place % 8 == 0;
        place += 1;
        for ((bits, &grey), &centre) in plane.iter_mut().zip(others).zip(centre) {
            let before = if fresh { 0 } else { *bits << 1 };
            *bits = before | u8::from(grey < centre);
        }
        if let Some(masked) = masked {
            // A masked pixel is never below the centre.
            plane.iter_mut().zip(masked).for_each(|(bits, &masked)| *bits &= !(masked as u8 & 1));
        }
    });
    let pixels = image.pixels.row(y);
    let width = pixels.len();
    let at = |x: usize| if greys.mirrored { width - 1 - x } else { x };
    for (c, channel) in row.channels.iter_mut().enumerate() {
        channel[inside.clone()]
            .iter_mut()
            .enumerate()
            .for_each(|(x, out)| *out = (pixels[at(x)][c] >> 8) as u8);
    }
    let masked = image.masked.row(y);
    row.masked[inside].iter_mut().enumerate().for_each(|(x, out)| *out = u8::from(masked[at(x)]));
}

/// The weight of colour at each pixel of a row, and the sums that it is computed from.
struct Contrast {
    weights: Vec<u16>,
    /// Sums of grey, and of its square, over the window.
    sums: Vec<u16>,
    squares: Vec<u32>,
}

impl Contrast {
    fn new(width: usize) -> Self {
        Self { weights: vec![0; width], sums: vec![0; width], squares: vec![0; width] }
    }
}

/// The weight of colour at each pixel of row `y`, from the variance of grey around it.
#[pulp::with_simd(colour_weights = pulp::Arch::new())]
#[inline(always)]
fn colour_weights_on<'a, S: pulp::Simd>(
    _: S,
    plan: &'a Plan,
    greys: &'a Greys,
    y: usize,
    contrast: &'a mut Contrast,
) {
    let Contrast { weights, sums, squares } = contrast;
    let (full, most) = (plan.colour_weight(), plan.colour_variance());
    if full == 0 || most == 0 {
        weights.fill(full as u16);
        return;
    }
    let centre = greys.row(y);
    sums.fill(0);
    squares.fill(0);
    let (sums, squares) = (&mut sums[..centre.len()], &mut squares[..centre.len()]);
    greys.around(y, |_, _, others, masked| {
        let mut add = |i: usize, grey: u16| {
            let grey = grey >> 8;
            sums[i] += grey;
            squares[i] += u32::from(grey * grey);
        };
        match masked {
            None => others.iter().enumerate().for_each(|(i, &grey)| add(i, grey)),
            Some(masked) => {
                (0..others.len()).for_each(|i| add(i, others[i] & !masked[i] | centre[i] & masked[i]));
            }
        }
    });
    for (weight, (sum, square)) in weights.iter_mut().zip(sums.iter().zip(squares.iter())) {
        let (sum, square) = (u32::from(*sum), *square);
        *weight = (full * (CENSUS_PLACES * square - sum * sum).min(most) / most) as u16;
    }
}

fn sad(plan: &Plan, pair: &Pair, out: &mut [u8]) {
    let level = &plan.levels[0];
    let (width, height) = (level.width, level.height);
    let radius = plan.method.cost.sad_window as usize / 2;
    let (left, right) = (pair.left(), pair.right());
    out.par_chunks_mut(width * level.stride).enumerate().for_each_init(
        || vec![(0u64, 0u32); width + 1],
        |sums, (y, row)| {
            for costs in row.chunks_exact_mut(level.stride) {
                costs[..level.labels].fill(plan.outside_cost);
                costs[level.labels..].fill(u8::MAX);
            }
            let rows = y.saturating_sub(radius)..(y + radius + 1).min(height);
            for j in 0..level.labels {
                let d = i64::from(level.min) + j as i64;
                let inside = d.max(0)..(width as i64 + d.min(0));
                if inside.is_empty() {
                    continue;
                }
                let inside = inside.start as usize..inside.end as usize;
                // Running sums along the row of (difference, valid pairs) over the window's rows.
                let mut running = (0u64, 0);
                sums[inside.start] = running;
                for x in inside.clone() {
                    let xr = (x as i64 - d) as usize;
                    for ny in rows.clone() {
                        if !left.masked[(x, ny)] && !right.masked[(xr, ny)] {
                            running.0 += u64::from(difference(left.pixels[(x, ny)], right.pixels[(xr, ny)]));
                            running.1 += 1;
                        }
                    }
                    sums[x + 1] = running;
                }
                for x in inside.clone() {
                    let xr = (x as i64 - d) as usize;
                    if left.masked[(x, y)] || right.masked[(xr, y)] {
                        continue;
                    }
                    let from = sums[x.saturating_sub(radius).max(inside.start)];
                    let to = sums[(x + radius + 1).min(inside.end)];
                    let (sum, count) = ((to.0 - from.0) as u32, to.1 - from.1);
                    row[x * level.stride + j] =
                        ((sum + 384 * count) / (768 * count)).min(COST_MAX.into()) as u8;
                }
            }
        },
    );
}
