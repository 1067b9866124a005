//! The weighted median of the disparities: see [`crate::backend::Stage::Median`].
//!
//! The lanes of vectors are neighbouring pixels of a row: values of one place of the window are adjacent, and
//! no sum crosses lanes. Values are searched as bytes, in steps from a base per lane: each pass over the
//! window sums the weights below a value, and halves the interval of the median. This needs no sorting.

use crate::backend::cpu::least_squares::Planes;
use crate::backend::cpu::places::{LANES, Values, Weighed};
use crate::backend::cpu::units::{block, each_lane};
use crate::image::{Image, Pair, Plane};
use crate::maps::{has_disparity, is_filled};
use crate::options::Median;
use crate::plan::Plan;
use crate::plan::planes::PLANE_START_BITS;
use crate::stage::MapSet;
use crate::threads::prelude::*;
use crate::weights::{MEDIAN_WEIGHT, MedianWeights, WINDOW_ROW_BITS};

pub(super) fn run(maps: &mut MapSet, plan: &Plan, pair: &Pair) {
    let guide = pair.left();
    smooth(&MedianWeights::of(&plan.method), touched(plan), None, guide, maps);
}

/// Whether the median changes a pixel with these flags.
pub(super) fn touched(plan: &Plan) -> impl Fn(u8) -> bool + Sync {
    let median = plan.method.refinement.median;
    move |f: u8| match median {
        Median::Off => false,
        Median::Filled => is_filled(f),
        Median::All => has_disparity(f),
    }
}

/// Applies the median to the pixels whose flags are `touched`, all of which must have a disparity. With
/// `limits`, fits planes afterwards, with values clamped to these.
pub(super) fn smooth(
    weights: &MedianWeights,
    touched: impl Fn(u8) -> bool + Sync,
    limits: Option<(i32, i32)>,
    guide: &Image,
    maps: &mut MapSet,
) {
    let MapSet { disparity, validity: flags, .. } = maps;
    let width = disparity.width();
    let input = MedianInput::new(weights, guide, disparity, flags);
    let disparity = disparity.data_mut().par_chunks_mut(width).enumerate();
    disparity.for_each_init(MedianWindow::default, |window, (y, row)| {
        window.limits = limits;
        window.open(weights, &input, y);
        window.touched.clear();
        window.touched.extend(flags.row(y).iter().map(|&f| mask(touched(f))));
        window.touched.resize(width + LANES, 0);
        median_row(window, &input, row);
    });
}

/// Computes the touched pixels of the current row of `window`.
#[pulp::with_simd(median_row = crate::vectors::widest())]
#[inline(always)]
fn median_row_on<'a, S: pulp::Simd>(
    _: S,
    window: &'a mut MedianWindow,
    input: &'a MedianInput,
    row: &'a mut [i32],
) {
    let mut x = 0;
    while let Some(skipped) = window.touched[x..].iter().position(|&touched| touched > 0) {
        x += skipped;
        let touched: [u8; LANES] = *block(&window.touched, x);
        let results = window.results(input, x, &touched);
        for ((out, result), _) in row[x..].iter_mut().zip(results).zip(touched).filter(|each| each.1 > 0) {
            *out = result;
        }
        x += LANES;
    }
}

/// The input of the windows, with unknown pixels beyond the ends of rows.
struct MedianInput {
    /// Number of unknown pixels before each row.
    margin: usize,
    pitch: usize,
    height: usize,
    guides: [Vec<u8>; 3],
    /// The largest value for pixels with a disparity, else 0.
    known: Vec<u8>,
    values: Vec<i32>,
}

impl MedianInput {
    fn new(weights: &MedianWeights, guide: &Image, disparity: &Plane<i32>, flags: &Plane<u8>) -> Self {
        let (width, height) = disparity.size();
        let margin = weights.radius << weights.step_bits[0];
        let pitch = width + 2 * margin + LANES;
        let bytes = || vec![0; pitch * height];
        let [mut r, mut g, mut b, mut known] = [bytes(), bytes(), bytes(), bytes()];
        let mut values = vec![0; pitch * height];
        let guides = r.par_chunks_mut(pitch).zip(g.par_chunks_mut(pitch)).zip(b.par_chunks_mut(pitch));
        let rows = guides.zip(known.par_chunks_mut(pitch)).zip(values.par_chunks_mut(pitch));
        rows.enumerate().for_each(|(y, ((((r, g), b), known), values))| {
            let inside = margin..margin + width;
            let bytes = [r, g, b, known].map(|row| &mut row[inside.clone()]);
            seen_row(weights.scale, guide.pixels.row(y), flags.row(y), bytes);
            values[inside].copy_from_slice(disparity.row(y));
        });
        Self { margin, pitch, height, guides: [r, g, b], known, values }
    }
}

/// The guides of a row, and the pixels with a disparity.
#[pulp::with_simd(seen_row = crate::vectors::widest())]
#[inline(always)]
fn seen_row_on<'a, S: pulp::Simd>(
    _: S,
    scale: u32,
    pixels: &'a [[u16; 4]],
    flags: &'a [u8],
    out: [&'a mut [u8]; 4],
) {
    let [r, g, b, known] = out;
    for ((((pixel, r), g), b), (&flags, known)) in
        pixels.iter().zip(r).zip(g).zip(b).zip(flags.iter().zip(known))
    {
        let [red, green, blue, _] = pixel.map(|channel| ((u32::from(channel) * scale) >> 16) as u8);
        (*r, *g, *b) = (red, green, blue);
        *known = if has_disparity(flags) { u8::MAX } else { 0 };
    }
}

/// Without planes, the median is searched in steps of 2^this / 256 px, then within one step.
const COARSE_BITS: u32 = 8;

/// The windows of [`LANES`] adjacent pixels.
#[derive(Default)]
struct MedianWindow {
    /// Index of the row of the centres in the input.
    centre: usize,
    radius: usize,
    /// By place: index in the input for column 0, steps from the centre, and weight at equal colour.
    offsets: Vec<(usize, [i16; 2], u8)>,
    doublings: u32,
    /// Limits of the values of planes; `None` for the median alone.
    limits: Option<(i32, i32)>,
    planes: Planes,
    /// All bits set for each pixel of the row that changes.
    touched: Vec<u8>,
    /// The first `count` places have weight.
    weighed: Vec<Weighed>,
    values: Vec<Values>,
    /// The values in steps.
    steps: Vec<[i8; LANES]>,
    count: usize,
    /// Half of the weight of all places, rounded up.
    need: [u16; LANES],
    /// The steps of the medians.
    found: [i8; LANES],
}

impl MedianWindow {
    /// Moves to row `y`; rows outside the image are left out.
    fn open(&mut self, weights: &MedianWeights, input: &MedianInput, y: usize) {
        let [column_step, row_step] = weights.step_bits.map(|bits| 1 << bits);
        // The rows of the window, every second one.
        let (apart, reach) = (row_step << WINDOW_ROW_BITS, weights.radius >> WINDOW_ROW_BITS);
        let first = y - reach.min(y / apart) * apart;
        self.offsets.clear();
        for ny in (first..(y + reach * apart + 1).min(input.height)).step_by(apart) {
            for (column, &taken) in weights.space_row(ny.abs_diff(y) / row_step).iter().enumerate() {
                let steps = [
                    column as i16 - weights.radius as i16,
                    ((ny as i32 - y as i32) >> weights.step_bits[1]) as i16,
                ];
                if weights.checkered && (steps[0] + (steps[1] >> 1)) & 1 != 0 {
                    continue;
                }
                let near = MEDIAN_WEIGHT.saturating_sub(taken);
                self.offsets.push((ny * input.pitch + column * column_step, steps, near));
            }
        }
        self.radius = weights.radius;
        (self.centre, self.doublings) = (y * input.pitch + input.margin, weights.doublings);
        let most = self.offsets.len().next_multiple_of(2);
        self.weighed.resize(most, Weighed::default());
        self.values.resize(most, Values::default());
        self.steps.resize(most, [0; LANES]);
    }

    /// The results for the touched pixels from column `x` on: medians or planes.
    #[inline(always)]
    fn results(&mut self, input: &MedianInput, x: usize, touched: &[u8; LANES]) -> [i32; LANES] {
        // Round to the nearest step for planes, else down.
        let (bits, half) = if self.limits.is_some() {
            (PLANE_START_BITS, 1 << (PLANE_START_BITS - 1))
        } else {
            (COARSE_BITS, 0)
        };
        // Start at the own value of each lane, in whole steps.
        let own: &[i32; LANES] = block(&input.values, self.centre + x);
        let mut base: [i32; LANES] = each_lane(|i| ((own[i] + i32::from(half)) >> bits) << bits);
        self.weigh(input, x, touched);
        let found = loop {
            self.load(input, &base);
            self.find(&[-half; LANES], bits);
            let found: [i16; LANES] = each_lane(|i| i16::from(self.found[i]) << bits);
            // At the ends of the range of bytes, the search continues from there.
            let is_end = |i: usize| touched[i] > 0 && matches!(self.found[i], i8::MIN | i8::MAX);
            if !(0..LANES).any(is_end) {
                break found;
            }
            base = each_lane(|i| base[i] + i32::from(found[i]));
        };
        let Some((low, high)) = self.limits else {
            let middle: [i16; LANES] = each_lane(|i| found[i] + (1 << (COARSE_BITS - 1)));
            self.find(&middle, 0);
            return each_lane(|i| base[i] + i32::from(middle[i]) + i32::from(self.found[i]));
        };
        let weighed = &self.weighed[..self.count];
        let above = self.planes.above_medians(self.radius, weighed, &self.values, &found);
        each_lane(|i| (base[i] + i32::from(found[i]) + above[i]).clamp(low, high))
    }

    /// Finds the medians of the values relative to `origin`, in steps of 2^`bits`.
    #[inline(always)]
    fn find(&mut self, origin: &[i16; LANES], bits: u32) {
        let count = self.count;
        divide(&self.values[..count], origin, bits, &mut self.steps);
        // Places are summed in pairs.
        let pairs = count.next_multiple_of(2);
        search(&self.steps[..pairs], &self.weighed, &self.need, &mut self.found);
    }

    /// Finds the places with weight for any of the `touched` pixels.
    #[inline(always)]
    fn weigh(&mut self, input: &MedianInput, x: usize, touched: &[u8; LANES]) {
        let cells = input.known.len();
        let known = &input.known[..cells];
        let [red, green, blue] = input.guides.each_ref().map(|guide| &guide[..cells]);
        let centres: [[u8; LANES]; 3] = [red, green, blue].map(|guide| *block(guide, self.centre + x));
        let doublings = self.doublings;
        // The difference that takes all weight once doubled.
        let most = (MEDIAN_WEIGHT + 1) >> doublings;
        let mut count = 0;
        for &(offset, step, near) in &self.offsets {
            let at = offset + x;
            let r = apart(block(red, at), &centres[0]);
            let g = apart(block(green, at), &centres[1]);
            let b = apart(block(blue, at), &centres[2]);
            let apart: [u8; LANES] = each_lane(|i| r[i].saturating_add(g[i]).saturating_add(b[i]));
            let colour: [u8; LANES] = each_lane(|i| apart[i].min(most) << doublings);
            let known: &[u8; LANES] = block(known, at);
            let weights: [u8; LANES] = each_lane(|i| near.saturating_sub(colour[i]) & known[i] & touched[i]);
            self.weighed[count] = Weighed { at, step, weights };
            count += usize::from(weights != [0; LANES]);
        }
        self.count = count;
        if let Some(beyond) = self.weighed.get_mut(count) {
            beyond.weights = [0; LANES];
        }
    }

    /// Loads the values of the weighted places, relative to `base`, and sums the weights.
    #[inline(always)]
    fn load(&mut self, input: &MedianInput, base: &[i32; LANES]) {
        let mut total = [0u16; LANES];
        for (Values(values), Weighed { at, weights, .. }) in
            self.values.iter_mut().zip(&self.weighed[..self.count])
        {
            total = each_lane(|i| total[i].saturating_add(weights[i].into()));
            let all: &[i32; LANES] = block(&input.values, *at);
            *values = each_lane(|i| (all[i] - base[i]).clamp(i16::MIN.into(), i16::MAX.into()) as i16);
        }
        self.need = each_lane(|i| total[i].div_ceil(2));
    }
}

/// Divides `values`, relative to `origin`, into `steps` of 2^`bits`. (Like the search, it is a separate
/// function, because compilers split up the vectors of inlined code.)
#[pulp::with_simd(divide = crate::vectors::widest())]
#[inline(always)]
fn divide_on<'a, S: pulp::Simd>(
    _: S,
    values: &'a [Values],
    origin: &'a [i16; LANES],
    bits: u32,
    steps: &'a mut [[i8; LANES]],
) {
    for (steps, Values(values)) in steps.iter_mut().zip(values) {
        *steps = each_lane(|i| {
            (values[i].saturating_sub(origin[i]) >> bits).clamp(i8::MIN.into(), i8::MAX.into()) as i8
        });
    }
}

/// The medians of an even number of `steps`: the largest values with less weight below them than they `need`.
#[pulp::with_simd(search = crate::vectors::widest())]
#[inline(always)]
fn search_on<'a, S: pulp::Simd>(
    _: S,
    steps: &'a [[i8; LANES]],
    weighed: &'a [Weighed],
    need: &'a [u16; LANES],
    found: &'a mut [i8; LANES],
) {
    let mut all = [i8::MIN; LANES];
    let (steps, weighed) = (steps.as_chunks::<2>().0, weighed.as_chunks::<2>().0);
    // 64 twice, because 128 does not fit in a signed byte.
    for step in [64i8, 64, 64, 32, 16, 8, 4, 2, 1] {
        let end: [i8; LANES] = each_lane(|i| all[i].saturating_add(step));
        let mut below = [0u16; LANES];
        for ([a, b], [of_a, of_b]) in steps.iter().zip(weighed) {
            let a: [u8; LANES] = each_lane(|i| mask(a[i] < end[i]) & of_a.weights[i]);
            let b: [u8; LANES] = each_lane(|i| mask(b[i] < end[i]) & of_b.weights[i]);
            let both: [u8; LANES] = each_lane(|i| a[i].wrapping_add(b[i]));
            // No sum saturates, but with wrapping sums compilers vectorize over places instead of lanes.
            below = each_lane(|i| below[i].saturating_add(u16::from(both[i])));
        }
        all = each_lane(|i| if below[i] < need[i] { end[i] } else { all[i] });
    }
    *found = all;
}

/// Absolute differences.
#[inline(always)]
fn apart(guides: &[u8; LANES], centres: &[u8; LANES]) -> [u8; LANES] {
    let above: [u8; LANES] = each_lane(|i| guides[i].saturating_sub(centres[i]));
    let below: [u8; LANES] = each_lane(|i| centres[i].saturating_sub(guides[i]));
    each_lane(|i| above[i] | below[i])
}

/// All bits set if `yes`.
#[inline(always)]
fn mask(yes: bool) -> u8 {
    u8::from(yes).wrapping_neg()
}
