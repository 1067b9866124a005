//! Features of census and colour by row, and the costs computed from them.

use super::units::{Blocks, block, block_mut, each_lane};
use super::windows::{Window, Windows};
use crate::image::{Image, Pair};
use crate::plan::{
    CENSUS_BIT_COST, CENSUS_BITS, CENSUS_PLACES, CENSUS_RADIUS_X, CENSUS_RADIUS_Y, COLOUR_MOST, LABEL_BLOCK,
    Plan,
};
use crate::stage::Optimum;
use crate::threads::prelude::*;
use std::ops::Range;

const CENSUS_X: usize = CENSUS_RADIUS_X as usize;
const CENSUS_Y: isize = CENSUS_RADIUS_Y as isize;

/// Maximum distance from the label in [`Features::costs_near`].
pub(super) const FAR: usize = 3;

/// The features of all rows, if costs are not stored.
#[derive(Default)]
pub(super) struct Features {
    rows: Vec<RowFeatures>,
}

impl Features {
    /// Computes the features of a pair.
    pub(super) fn fill(&mut self, plan: &Plan, pair: &Pair) {
        let level = &plan.levels[0];
        let views = Views::new(plan, pair);
        self.rows.resize_with(level.height, || RowFeatures::new(plan));
        self.rows
            .par_iter_mut()
            .enumerate()
            .for_each_init(|| Sums::new(level.width), |sums, (y, row)| row.fill(&views, y, sums));
    }

    /// The costs of row `y`, \[x\]\[label\], with padding.
    pub(super) fn costs(&self, plan: &Plan, y: usize, out: &mut [u8]) {
        self.rows[y].costs(plan, out);
    }

    /// The costs of row `y` in `windows`, in the layout of volumes.
    pub(super) fn costs_in_windows(&self, plan: &Plan, windows: &Windows, y: usize, out: &mut [u8]) {
        window_row(plan, &self.rows[y], windows.row(y), out);
    }

    /// A byte each: the costs of row `y` around the labels of `optima`, from [`FAR`] below; undefined outside.
    pub(super) fn costs_near(&self, plan: &Plan, y: usize, optima: &[Optimum], out: &mut [u64]) {
        near_row(plan, &self.rows[y], optima, out);
    }
}

#[pulp::with_simd(cost_row = crate::vectors::widest())]
#[inline(always)]
fn cost_row_on<'a, S: pulp::Simd>(_: S, plan: &'a Plan, features: &'a RowFeatures, out: &'a mut [u8]) {
    let row = RowCosts { plan, features };
    for (x, costs) in out.chunks_exact_mut(plan.levels[0].stride).enumerate() {
        row.costs_of(x, 0, costs);
    }
}

#[pulp::with_simd(window_row = crate::vectors::widest())]
#[inline(always)]
fn window_row_on<'a, S: pulp::Simd>(
    _: S,
    plan: &'a Plan,
    features: &'a RowFeatures,
    windows: &'a [Window],
    out: &'a mut [u8],
) {
    let row = RowCosts { plan, features };
    for (x, window) in windows.iter().enumerate() {
        row.costs_of(x, window.first(), &mut out[window.cells()]);
    }
}

#[pulp::with_simd(near_row = crate::vectors::widest())]
#[inline(always)]
fn near_row_on<'a, S: pulp::Simd>(
    _: S,
    plan: &'a Plan,
    features: &'a RowFeatures,
    optima: &'a [Optimum],
    out: &'a mut [u64],
) {
    let row = RowCosts { plan, features };
    let last = plan.levels[0].stride - LABEL_BLOCK;
    for (x, (optimum, out)) in optima.iter().zip(out).enumerate() {
        let label = usize::from(optimum.label);
        let from = label.saturating_sub(FAR).min(last);
        let mut costs = [0; FAR + LABEL_BLOCK + size_of::<u64>()];
        row.costs_of(x, from, &mut costs[FAR..FAR + LABEL_BLOCK]);
        // Pixels of the right view may have no label.
        *out = u64::from_le_bytes(*block(&costs, (label - from).min(LABEL_BLOCK)));
    }
}

/// The costs of a row.
struct RowCosts<'a> {
    plan: &'a Plan,
    features: &'a RowFeatures,
}

impl RowCosts<'_> {
    /// The costs of the pixel at column `x` for labels from `from` on; past the last label they are the largest value.
    #[inline(always)]
    fn costs_of(&self, x: usize, from: usize, costs: &mut [u8]) {
        let (level, outside) = (&self.plan.levels[0], self.plan.outside_cost);
        let RowFeatures { left, right, weights, any_masked } = self.features;
        let (width, margin, pitch) = (level.width, left.margin, left.pitch);
        let labels = level.labels.saturating_sub(from).min(costs.len());
        // The right pixel of label index j is at `place` + j from the right.
        let place = (width - 1 - x) as i64 + i64::from(level.min);
        // Labels whose pixel is inside the right image.
        let first = (-place).max(0);
        let end = (width as i64 - place).min(level.labels as i64);
        // The values from this pixel on; below, those of the first label's pixel on.
        let here = &left.values[margin + x..];
        if here[Row::MASKED * pitch] != 0 || first >= end {
            costs[..labels].fill(outside);
            costs[labels..].fill(u8::MAX);
            return;
        }
        let place = (margin as i64 + place) as usize + from;
        let count = costs.len();
        let there = &right.values[place..];
        PixelCosts { here, there, pitch, weight: weights[x], costs: &mut *costs }.all(count);
        let among = |label: i64| (label - from as i64).clamp(0, labels as i64) as usize;
        let (first, end) = (among(first), among(end));
        if *any_masked {
            let masked = &there[Row::MASKED * pitch + first..];
            for (cost, &masked) in costs[first..end].iter_mut().zip(masked) {
                *cost = if masked == 0 { *cost } else { outside };
            }
        }
        // Most pixels need none of these, and even an empty fill takes time.
        if first > 0 {
            costs[..first].fill(outside);
        }
        if end < count {
            costs[end..labels].fill(outside);
            costs[labels..].fill(u8::MAX);
        }
    }
}

/// The costs of a left pixel against pixels of the right row.
struct PixelCosts<'a> {
    /// The values of the left pixel, `pitch` apart.
    here: &'a [u8],
    /// The values of the right pixels, from the first label's on.
    there: &'a [u8],
    pitch: usize,
    weight: u16,
    costs: &'a mut [u8],
}

impl PixelCosts<'_> {
    /// The values of both pixels in a plane, for the labels from `label` on.
    #[inline(always)]
    fn both<const N: usize>(&self, plane: usize, label: usize) -> (u8, &[u8; N]) {
        let plane = plane * self.pitch;
        (self.here[plane], block(self.there, plane + label))
    }
}

impl Blocks for PixelCosts<'_> {
    #[inline(always)]
    fn block<const N: usize>(&mut self, label: usize) {
        let mut bits = [0u8; N];
        for plane in Row::CENSUS {
            let (here, there) = self.both::<N>(plane, label);
            bits = each_lane(|i| bits[i] + (here ^ there[i]).count_ones() as u8);
        }
        let mut costs: [u8; N] = each_lane(|i| CENSUS_BIT_COST as u8 * bits[i].min(CENSUS_BITS as u8));
        if self.weight > 0 {
            let mut apart = [0u8; N];
            for plane in Row::CHANNELS {
                let (here, there) = self.both::<N>(plane, label);
                // Not abs_diff: compilers widen that to 32 bits.
                let difference = |a: u8, b: u8| a.saturating_sub(b) | b.saturating_sub(a);
                apart = each_lane(|i| apart[i].saturating_add(difference(here, there[i])));
            }
            let weighted: [u16; N] = each_lane(|i| self.weight * u16::from(apart[i].min(COLOUR_MOST as u8)));
            costs =
                each_lane(|i| costs[i] + ((weighted[i] + COLOUR_MOST as u16 / 2) / COLOUR_MOST as u16) as u8);
        }
        *block_mut(self.costs, label) = costs;
    }
}

/// The grey of an image, with replicated columns at both borders for the census.
struct Greys {
    size: (usize, usize),
    mirrored: bool,
    /// Rows with [`CENSUS_X`] extra columns on either side.
    values: Vec<u16>,
    /// 0, or the largest value at masked pixels; `None` if no pixel is masked.
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

    /// Calls `see` for every offset (dx, dy) of the window around the pixels of row `y`, with the greys and
    /// masks at that offset for the whole row, for vectors.
    #[inline(always)]
    fn around(&self, y: usize, mut see: impl FnMut(isize, isize, &[u16], Option<&[u16]>)) {
        let (width, height) = self.size;
        for dy in -CENSUS_Y..=CENSUS_Y {
            let ny = (y as isize + dy).clamp(0, height as isize - 1) as usize;
            for i in 0..=2 * CENSUS_X {
                // In the order of the original image, even if mirrored.
                let column = if self.mirrored { 2 * CENSUS_X - i } else { i };
                let there = ny * (width + 2 * CENSUS_X) + column..;
                let masked = self.masked.as_ref().map(|masked| &masked[there.clone()][..width]);
                see(i as isize - CENSUS_X as isize, dy, &self.values[there][..width], masked);
            }
        }
    }

    /// The greys of all rows of the window, with the extra columns.
    #[inline(always)]
    fn rows_around(&self, y: usize) -> impl Iterator<Item = &[u16]> {
        let (width, height) = self.size;
        let pitch = width + 2 * CENSUS_X;
        (-CENSUS_Y..=CENSUS_Y).map(move |dy| {
            let ny = y.saturating_add_signed(dy).min(height - 1);
            &self.values[ny * pitch..][..pitch]
        })
    }

    /// The greys of row `y`.
    fn row(&self, y: usize) -> &[u16] {
        let (width, _) = self.size;
        &self.values[y * (width + 2 * CENSUS_X) + CENSUS_X..][..width]
    }
}

/// The grey of both views. The right one is mirrored, so that ascending labels are adjacent.
pub(super) struct Views<'a> {
    plan: &'a Plan,
    pair: &'a Pair,
    greys: [Greys; 2],
}

impl<'a> Views<'a> {
    pub(super) fn new(plan: &'a Plan, pair: &'a Pair) -> Self {
        Self { plan, pair, greys: [Greys::new(pair.left(), false), Greys::new(pair.right(), true)] }
    }
}

/// The features of a row, from which its costs are computed.
pub(super) struct RowFeatures {
    left: Row,
    right: Row,
    /// The weight of colour at each pixel.
    weights: Vec<u16>,
    /// Whether any pixel of the right row is masked.
    any_masked: bool,
}

impl RowFeatures {
    pub(super) fn new(plan: &Plan) -> Self {
        let level = &plan.levels[0];
        let row = || Row::new(level.width, level.stride);
        Self { left: row(), right: row(), weights: vec![0; level.width], any_masked: false }
    }

    /// Computes the features of row `y`.
    pub(super) fn fill(&mut self, views: &Views, y: usize, sums: &mut Sums) {
        let [left, right] = &views.greys;
        fill_row(&mut self.left, views.pair.left(), left, y);
        fill_row(&mut self.right, views.pair.right(), right, y);
        colour_weights(views.plan, left, y, sums, &mut self.weights);
        self.any_masked = self.right.pixels_mut(Row::MASKED).iter().any(|&masked| masked != 0);
    }

    /// The costs of the row, \[x\]\[label\], with padding.
    pub(super) fn costs(&self, plan: &Plan, out: &mut [u8]) {
        cost_row(plan, self, out);
    }
}

/// A row of an image in the layout for costs, with a margin of as many pixels as labels at either end.
struct Row {
    margin: usize,
    pitch: usize,
    /// \[plane\]\[margin, pixels, margin\]: eight census bits per plane, then the channels in 8-bit levels,
    /// then 1 for masked pixels, else 0.
    values: Vec<u8>,
}

impl Row {
    const CENSUS: Range<usize> = 0..8;
    const CHANNELS: Range<usize> = 8..11;
    const MASKED: usize = 11;
    const PLANES: usize = 12;

    fn new(width: usize, margin: usize) -> Self {
        let pitch = width + 2 * margin;
        Self { margin, pitch, values: vec![0; Self::PLANES * pitch] }
    }

    /// The pixels of a plane.
    #[inline(always)]
    fn pixels_mut(&mut self, plane: usize) -> &mut [u8] {
        &mut self.values[plane * self.pitch..][self.margin..self.pitch - self.margin]
    }
}

/// Computes the features of row `y` of an image.
#[pulp::with_simd(fill_row = crate::vectors::widest())]
#[inline(always)]
fn fill_row_on<'a, S: pulp::Simd>(_: S, row: &'a mut Row, image: &'a Image, greys: &'a Greys, y: usize) {
    let centre = greys.row(y);
    let mut place = 0;
    greys.around(y, |dx, dy, others, masked| {
        if (dx, dy) == (0, 0) {
            return;
        }
        let plane = row.pixels_mut(place / 8);
        let fresh = place % 8 == 0;
        place += 1;
        for ((bits, &grey), &centre) in plane.iter_mut().zip(others).zip(centre) {
            let before = if fresh { 0 } else { *bits << 1 };
            *bits = before | u8::from(grey < centre);
        }
        if let Some(masked) = masked {
            // A masked pixel never counts as below the centre.
            plane.iter_mut().zip(masked).for_each(|(bits, &masked)| *bits &= !(masked as u8 & 1));
        }
    });
    let pixels = image.pixels.row(y);
    let width = pixels.len();
    let at = |x: usize| if greys.mirrored { width - 1 - x } else { x };
    for (c, plane) in Row::CHANNELS.enumerate() {
        let channel = row.pixels_mut(plane).iter_mut().enumerate();
        channel.for_each(|(x, out)| *out = (pixels[at(x)][c] >> 8) as u8);
    }
    let masked = image.masked.row(y);
    let out = row.pixels_mut(Row::MASKED).iter_mut().enumerate();
    out.for_each(|(x, out)| *out = u8::from(masked[at(x)]));
}

/// Sums of grey and squared grey over the window around each pixel of a row.
pub(super) struct Sums {
    greys: Vec<u16>,
    squares: Vec<u32>,
    /// Sums over the columns of the windows.
    columns: (Vec<u16>, Vec<u32>),
}

impl Sums {
    pub(super) fn new(width: usize) -> Self {
        let columns = width + 2 * CENSUS_X;
        Self { greys: vec![0; width], squares: vec![0; width], columns: (vec![0; columns], vec![0; columns]) }
    }
}

/// The weight of colour at each pixel of row `y`, by the variance of grey around it.
#[pulp::with_simd(colour_weights = crate::vectors::widest())]
#[inline(always)]
fn colour_weights_on<'a, S: pulp::Simd>(
    _: S,
    plan: &'a Plan,
    greys: &'a Greys,
    y: usize,
    sums: &'a mut Sums,
    weights: &'a mut [u16],
) {
    let (full, most) = (plan.colour_weight(), plan.colour_variance());
    if full == 0 || most == 0 {
        weights.fill(full as u16);
        return;
    }
    let centre = greys.row(y);
    let Sums { greys: sums, squares, columns: (column_sums, column_squares) } = sums;
    sums.fill(0);
    squares.fill(0);
    let add = |sum: &mut u16, square: &mut u32, grey: u16| {
        let grey = grey >> 8;
        *sum += grey;
        *square += u32::from(grey * grey);
    };
    if greys.masked.is_none() {
        column_sums.fill(0);
        column_squares.fill(0);
        for row in greys.rows_around(y) {
            let columns = column_sums.iter_mut().zip(column_squares.iter_mut());
            columns.zip(row).for_each(|((sum, square), &grey)| add(sum, square, grey));
        }
        for i in 0..=2 * CENSUS_X {
            sums.iter_mut().zip(&column_sums[i..]).for_each(|(sum, column)| *sum += column);
            squares.iter_mut().zip(&column_squares[i..]).for_each(|(square, column)| *square += column);
        }
    }
    // The centre replaces masked pixels, so columns cannot be shared between windows.
    greys.around(y, |_, _, others, masked| {
        let Some(masked) = masked else { return };
        for (i, (sum, square)) in sums.iter_mut().zip(squares.iter_mut()).enumerate() {
            add(sum, square, others[i] & !masked[i] | centre[i] & masked[i]);
        }
    });
    // n / most for n below 2^32, as the upper half of a product (Lemire, Kaser and Kurz 2019); a division takes ten times as long.
    let reciprocal = (1 << 64) / u128::from(most) + 1;
    let divided = |n: u32| ((reciprocal * u128::from(n)) >> 64) as u16;
    for (weight, (sum, square)) in weights.iter_mut().zip(sums.iter().zip(squares.iter())) {
        let (sum, square) = (u32::from(*sum), *square);
        *weight = divided(full * (CENSUS_PLACES * square - sum * sum).min(most));
    }
}
