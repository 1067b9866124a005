//! The weighted median of the disparities: see [`crate::backend::Stage::Median`].
//!
//! Neighbouring pixels of a row are the lanes of vectors: what a place of the window holds for all of them is adjacent, and no sum
//! crosses lanes. Values are searched as bytes, in steps from a base of each lane: every pass over the window sums the weights of
//! what is below a value, and halves the interval with the median. This needs no sort.

use crate::backend::cpu::least_squares::Planes;
use crate::backend::cpu::places::{LANES, Values, Weighed};
use crate::backend::cpu::units::{block, each_lane};
use crate::image::{Image, Pair, Plane};
use crate::maps::{flag, has_disparity};
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

/// Whether the median changes a pixel with such flags.
pub(super) fn touched(plan: &Plan) -> impl Fn(u8) -> bool + Sync {
    let median = plan.method.refinement.median;
    move |f: u8| match median {
        Median::Off => false,
        Median::Filled => f & flag::FILLED != 0,
        Median::All => has_disparity(f),
    }
}

/// Applies the median to every pixel whose flags are `touched`. Such a pixel has a disparity. Where there are `limits`, planes
/// follow, whose values stay within.
pub(super) fn smooth(
    weights: &MedianWeights,
    touched: impl Fn(u8) -> bool + Sync,
    limits: Option<(i32, i32)>,
    guide: &Image,
    maps: &mut MapSet,
) {
    let MapSet { disparity, validity: flags, .. } = maps;
    let width = disparity.width();
    let seen = Seen::new(weights, guide, disparity, flags);
    let disparity = disparity.data_mut().par_chunks_mut(width).enumerate();
    disparity.for_each_init(Window::default, |window, (y, row)| {
        window.limits = limits;
        window.open(weights, &seen, y);
        window.touched.clear();
        window.touched.extend(flags.row(y).iter().map(|&f| mask(touched(f))));
        window.touched.resize(width + LANES, 0);
        median_row(window, &seen, row);
    });
}

/// The results of the touched pixels of the row that `window` is open at.
#[pulp::with_simd(median_row = crate::vectors::widest())]
#[inline(always)]
fn median_row_on<'a, S: pulp::Simd>(_: S, window: &'a mut Window, seen: &'a Seen, row: &'a mut [i32]) {
    let mut x = 0;
    while let Some(skipped) = window.touched[x..].iter().position(|&touched| touched > 0) {
        x += skipped;
        let touched: [u8; LANES] = *block(&window.touched, x);
        let results = window.results(seen, x, &touched);
        for ((out, result), _) in row[x..].iter_mut().zip(results).zip(touched).filter(|each| each.1 > 0) {
            *out = result;
        }
        x += LANES;
    }
}

/// The input of the windows, with unknown pixels beyond the ends of the rows.
struct Seen {
    /// Number of unknown pixels before each row.
    margin: usize,
    pitch: usize,
    height: usize,
    guides: [Vec<u8>; 3],
    /// The largest value where there is a disparity, else 0.
    known: Vec<u8>,
    values: Vec<i32>,
}

impl Seen {
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

/// The guides of a row, and where it is known.
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

/// Without planes, the median is searched in steps of 2 to so many 1/256 px, and then within one of them.
const COARSE_BITS: u32 = 8;

/// The windows of [`LANES`] adjacent pixels.
#[derive(Default)]
struct Window {
    /// Where the row of the centres starts in the input.
    centre: usize,
    radius: usize,
    /// By place: where it lies in the input for the pixel in column 0, how many steps from the centre, and the weight of what has
    /// the colour of the centre there.
    offsets: Vec<(usize, [i16; 2], u8)>,
    doublings: u32,
    /// What the values of planes stay within, where planes follow the median.
    limits: Option<(i32, i32)>,
    planes: Planes,
    /// All bits for each pixel of the row that takes its median.
    touched: Vec<u8>,
    /// The first `count` places have weight.
    weighed: Vec<Weighed>,
    values: Vec<Values>,
    /// The same values in steps.
    steps: Vec<[i8; LANES]>,
    count: usize,
    /// Half of the weight of all places, rounded up.
    need: [u16; LANES],
    /// The steps of the medians.
    found: [i8; LANES],
}

impl Window {
    /// Moves to row `y`, whose windows leave out what is above and below the image.
    fn open(&mut self, weights: &MedianWeights, seen: &Seen, y: usize) {
        let [column_step, row_step] = weights.step_bits.map(|bits| 1 << bits);
        // The rows of the window, without those that it skips.
        let (apart, reach) = (row_step << WINDOW_ROW_BITS, weights.radius >> WINDOW_ROW_BITS);
        let first = y - reach.min(y / apart) * apart;
        self.offsets.clear();
        for ny in (first..(y + reach * apart + 1).min(seen.height)).step_by(apart) {
            for (column, &taken) in weights.space_row(ny.abs_diff(y) / row_step).iter().enumerate() {
                let steps = [
                    column as i16 - weights.radius as i16,
                    ((ny as i32 - y as i32) >> weights.step_bits[1]) as i16,
                ];
                if weights.checkered && (steps[0] + (steps[1] >> 1)) & 1 != 0 {
                    continue;
                }
                let near = MEDIAN_WEIGHT.saturating_sub(taken);
                self.offsets.push((ny * seen.pitch + column * column_step, steps, near));
            }
        }
        self.radius = weights.radius;
        (self.centre, self.doublings) = (y * seen.pitch + seen.margin, weights.doublings);
        let most = self.offsets.len().next_multiple_of(2);
        self.weighed.resize(most, Weighed::default());
        self.values.resize(most, Values::default());
        self.steps.resize(most, [0; LANES]);
    }

    /// The medians, or what planes make of them, of the pixels from column `x` on, as far as they are `touched`.
    #[inline(always)]
    fn results(&mut self, seen: &Seen, x: usize, touched: &[u8; LANES]) -> [i32; LANES] {
        // To the nearest step where planes follow, else to the one below.
        let (bits, half) = if self.limits.is_some() {
            (PLANE_START_BITS, 1 << (PLANE_START_BITS - 1))
        } else {
            (COARSE_BITS, 0)
        };
        // Each lane's own value, at first, in whole steps.
        let own: &[i32; LANES] = block(&seen.values, self.centre + x);
        let mut base: [i32; LANES] = each_lane(|i| ((own[i] + i32::from(half)) >> bits) << bits);
        self.weigh(seen, x, touched);
        let found = loop {
            self.load(seen, &base);
            self.find(&[-half; LANES], bits);
            let found: [i16; LANES] = each_lane(|i| i16::from(self.found[i]) << bits);
            // Beyond the ends of a byte the search goes on from there.
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

    /// Finds the medians of the values, less `origin`, in steps of 2 to `bits`.
    #[inline(always)]
    fn find(&mut self, origin: &[i16; LANES], bits: u32) {
        let count = self.count;
        divide(&self.values[..count], origin, bits, &mut self.steps);
        // Places are summed in pairs.
        let pairs = count.next_multiple_of(2);
        search(&self.steps[..pairs], &self.weighed, &self.need, &mut self.found);
    }

    /// Finds the places that have weight for any of the pixels `touched`.
    #[inline(always)]
    fn weigh(&mut self, seen: &Seen, x: usize, touched: &[u8; LANES]) {
        let cells = seen.known.len();
        let known = &seen.known[..cells];
        let [red, green, blue] = seen.guides.each_ref().map(|guide| &guide[..cells]);
        let centres: [[u8; LANES]; 3] = [red, green, blue].map(|guide| *block(guide, self.centre + x));
        let doublings = self.doublings;
        // The value that takes all of the weight once it is doubled.
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

    /// Loads the values of all places that have weight, relative to `base`, and sums the weights.
    #[inline(always)]
    fn load(&mut self, seen: &Seen, base: &[i32; LANES]) {
        let mut total = [0u16; LANES];
        for (Values(values), Weighed { at, weights, .. }) in
            self.values.iter_mut().zip(&self.weighed[..self.count])
        {
            total = each_lane(|i| total[i].saturating_add(weights[i].into()));
            let all: &[i32; LANES] = block(&seen.values, *at);
            *values = each_lane(|i| (all[i] - base[i]).clamp(i16::MIN.into(), i16::MAX.into()) as i16);
        }
        self.need = each_lane(|i| total[i].div_ceil(2));
    }
}

/// Divides `values`, less `origin`, into `steps` of 2 to `bits`. (A function of its own, as is the search: within another, compilers
/// take vectors apart.)
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

/// The medians of `steps`, whose number is even: the largest values below which there is less weight than they `need`.
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
    // Twice 64, since 128 is no number of 8 bits with a sign.
    for step in [64i8, 64, 64, 32, 16, 8, 4, 2, 1] {
        let end: [i8; LANES] = each_lane(|i| all[i].saturating_add(step));
        let mut below = [0u16; LANES];
        for ([a, b], [of_a, of_b]) in steps.iter().zip(weighed) {
            let a: [u8; LANES] = each_lane(|i| mask(a[i] < end[i]) & of_a.weights[i]);
            let b: [u8; LANES] = each_lane(|i| mask(b[i] < end[i]) & of_b.weights[i]);
            let both: [u8; LANES] = each_lane(|i| a[i].wrapping_add(b[i]));
            // No sum saturates, but of sums that may wrap compilers make vectors of places.
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

/// All bits of `yes`.
#[inline(always)]
fn mask(yes: bool) -> u8 {
    u8::from(yes).wrapping_neg()
}
