//! The weighted median of the disparities: see [`crate::backend::Stage::Median`].
//!
//! Neighbouring pixels of a row are the lanes of vectors: what a place of the window holds for all of them is adjacent, and no sum
//! crosses lanes. Each lane bisects an interval of its own, from the smallest to the largest value in its window that has
//! weight. Every step sums the weights of the values below the middle. This needs no sort.

use super::least_squares::Planes;
use super::places::{LANES, Place, Weighed};
use super::units::{block, block_mut, each_lane};
use crate::image::{Image, Pair, Plane};
use crate::maps::{flag, has_disparity};
use crate::options::Median;
use crate::plan::Plan;
use crate::stage::MapSet;
use crate::weights::{MEDIAN_WEIGHT, MedianWeights, WINDOW_ROW_BITS};
use rayon::prelude::*;

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
        window.open(weights, &seen, y);
        window.limits = limits;
        window.touched.clear();
        window.touched.extend(flags.row(y).iter().map(|&f| touched(f)));
        window.touched.resize(width + LANES, false);
        median_row(window, &seen, row);
    });
}

/// The results of the touched pixels of the row that `window` is open at.
#[pulp::with_simd(median_row = pulp::Arch::new())]
#[inline(always)]
fn median_row_on<'a, S: pulp::Simd>(_: S, window: &'a mut Window, seen: &'a Seen, row: &'a mut [i32]) {
    let mut x = 0;
    while let Some(skipped) = window.touched[x..].iter().position(|&touched| touched) {
        x += skipped;
        let touched: [bool; LANES] = *block(&window.touched, x);
        let results = window.results(seen, x, &touched);
        for ((out, result), _) in row[x..].iter_mut().zip(results).zip(touched).filter(|each| each.1) {
            *out = result;
        }
        x += LANES;
    }
}

/// Number of pixels whose medians are found together, in vectors of 16 bits.
const HALF: usize = LANES / 2;
/// A guess of a median is too far from it where it misses by this much: values at the ends of 16 bits may then be near it.
const FAR: u16 = 1 << 14;
/// Number of places whose weights are summed before they join the others.
const GROUP: usize = 4;
/// Sums of this many weights fit in 16 bits.
const PART: usize = 512;

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
#[pulp::with_simd(seen_row = pulp::Arch::new())]
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
    /// Whether each pixel of the row takes its median.
    touched: Vec<bool>,
    /// The first `count` places have weight.
    weighed: Vec<Weighed>,
    places: Vec<Place>,
    count: usize,
}

/// What is known of the medians before the search, for all lanes.
struct Bounds {
    /// The smallest and the largest of the guess and the values that have weight.
    low: [i16; LANES],
    high: [i16; LANES],
    /// The weight that the values up to the median have at least: half of all, rounded up. It fits in 16 bits, since windows have at most
    /// 31 x 31 places.
    need: [u16; LANES],
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
                let near = MEDIAN_WEIGHT.saturating_sub(taken);
                self.offsets.push((ny * seen.pitch + column * column_step, steps, near));
            }
        }
        self.radius = weights.radius;
        (self.centre, self.doublings) = (y * seen.pitch + seen.margin, weights.doublings);
        self.weighed.resize(self.offsets.len(), Weighed::default());
        self.places.resize(self.offsets.len().next_multiple_of(GROUP), Place::default());
    }

    /// The medians, or what planes make of them, of the pixels from column `x` on, as far as they are `touched`.
    #[inline(always)]
    fn results(&mut self, seen: &Seen, x: usize, touched: &[bool; LANES]) -> [i32; LANES] {
        let mut medians: [i32; LANES] = *block(&seen.values, self.centre + x);
        self.weigh(seen, x, touched);
        let mut found = [0i16; LANES];
        loop {
            let bounds = self.load(seen, &medians);
            for first in [0, HALF] {
                *block_mut(&mut found, first) = self.search(&bounds, first, block(touched, first));
            }
            medians = each_lane(|i| medians[i] + i32::from(found[i]));
            // A median out of the reach of its guess is searched for again, from there.
            if found.iter().zip(touched).all(|(found, &touched)| !touched || found.unsigned_abs() < FAR) {
                break;
            }
        }
        let Some((low, high)) = self.limits else { return medians };
        self.planes.choose(&self.weighed[..self.count]);
        let above = self.planes.above_medians(self.radius, &self.places, &found);
        each_lane(|i| (medians[i] + above[i]).clamp(low, high))
    }

    /// Finds the places that have weight for any of the pixels `touched`.
    #[inline(always)]
    fn weigh(&mut self, seen: &Seen, x: usize, touched: &[bool; LANES]) {
        let cells = seen.known.len();
        let known = &seen.known[..cells];
        let [red, green, blue] = seen.guides.each_ref().map(|guide| &guide[..cells]);
        let centres: [[u8; LANES]; 3] = [red, green, blue].map(|guide| *block(guide, self.centre + x));
        let doublings = self.doublings;
        // The value that takes all of the weight once it is doubled.
        let most = (MEDIAN_WEIGHT + 1) >> doublings;
        let touched: [u8; LANES] = each_lane(|i| u8::from(touched[i]).wrapping_neg());
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
    }

    /// Loads the values of all places that have weight, relative to the guesses.
    #[inline(always)]
    fn load(&mut self, seen: &Seen, guess: &[i32; LANES]) -> Bounds {
        let (mut low, mut high) = ([0i16; LANES], [0i16; LANES]);
        let mut total = [0u32; LANES];
        let weighed = &self.weighed[..self.count];
        for (places, weighed) in self.places.chunks_mut(PART).zip(weighed.chunks(PART)) {
            let mut part = [0u16; LANES];
            for (place, Weighed { at, weights, .. }) in places.iter_mut().zip(weighed) {
                let weights: [u16; LANES] = each_lane(|i| weights[i].into());
                let values: &[i32; LANES] = block(&seen.values, *at);
                let values: [i16; LANES] =
                    each_lane(|i| (values[i] - guess[i]).clamp(i16::MIN.into(), i16::MAX.into()) as i16);
                let weighted: [i16; LANES] = each_lane(|i| values[i] & mask(weights[i] > 0) as i16);
                low = each_lane(|i| low[i].min(weighted[i]));
                high = each_lane(|i| high[i].max(weighted[i]));
                part = each_lane(|i| part[i] + weights[i]);
                *place = Place { values, weights };
            }
            total = each_lane(|i| total[i] + u32::from(part[i]));
        }
        // Groups are whole.
        let whole = self.count.next_multiple_of(GROUP);
        self.places[self.count..whole].fill(Place::default());
        Bounds { low, high, need: each_lane(|i| total[i].div_ceil(2) as u16) }
    }

    /// The medians of half of the lanes, from lane `first` on: the largest values below which there is less weight than needed.
    #[inline(always)]
    fn search(&self, bounds: &Bounds, first: usize, touched: &[bool; HALF]) -> [i16; HALF] {
        let [low, high]: [&[i16; HALF]; 2] = [block(&bounds.low, first), block(&bounds.high, first)];
        let need: &[u16; HALF] = block(&bounds.need, first);
        let spans: [u16; HALF] = each_lane(|i| if touched[i] { high[i].abs_diff(low[i]) } else { 0 });
        let mut found = *low;
        let mut steps = u16::BITS - spans.iter().fold(0, |all, span| all | span).leading_zeros();
        while steps > 0 {
            steps -= 1;
            // A step may take all 16 bits; its halves leave room for the sign.
            let [less, more] = [(1u16 << steps) / 2, (1u16 << steps).div_ceil(2)].map(|part| part as i16);
            let end: [i16; HALF] = each_lane(|i| found[i].saturating_add(less).saturating_add(more));
            let mut below = [0u16; HALF];
            for places in self.places[..self.count.next_multiple_of(GROUP)].as_chunks::<GROUP>().0 {
                let mut part = [0u16; HALF];
                for place in places {
                    let values: &[i16; HALF] = block(&place.values, first);
                    let weights: &[u16; HALF] = block(&place.weights, first);
                    part = each_lane(|i| part[i] + (mask(values[i] < end[i]) & weights[i]));
                }
                below = each_lane(|i| below[i].saturating_add(part[i]));
            }
            found = each_lane(|i| if below[i] < need[i] { end[i] } else { found[i] });
        }
        found
    }
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
fn mask(yes: bool) -> u16 {
    u16::from(yes).wrapping_neg()
}
