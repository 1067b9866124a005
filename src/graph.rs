//! The graph: the dependency factors S of one level (sections 2.1 and 3.1).
//!
//! There is one factor per pixel. Its members are the pixel and those neighbours in a 7 x 7 window whose
//! bilateral coefficient `exp(-(dx^2 + dy^2) / 2 sigma_d^2 - |colour difference|^2 / 2 sigma_r^2)` reaches
//! the percentile. Only the order of the coefficients matters, so their exponents are compared, as integers.
//! Ties are broken by distance and then by raster order, so every machine picks the same graph. The centre's
//! own coefficient is always the largest; the percentile is taken over the 48 others (the paper leaves this
//! open).

use crate::image::{Image, Plane};
use crate::options::Method;
use crate::plan::{GRAPH_WINDOW, Plan};
use crate::threads::prelude::*;
use std::ops::Range;

/// The code of an empty slot: the neighbour is outside the image, masked, or missing.
pub(crate) const NO_MEMBER: u8 = u8::MAX;
const RADIUS: i32 = GRAPH_WINDOW as i32 / 2;
/// Rows of pixels whose factors are collected together.
const BAND: usize = 64;

/// The dependency factors of one level.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LevelGraph {
    width: usize,
    height: usize,
    neighbours: usize,
    codes: Vec<u8>,
    /// Raster offset of a member from its factor, by code.
    steps: Vec<isize>,
    starts: Vec<u32>,
    incoming: Vec<Incoming>,
}

/// An entry of the transposed table: a factor, relative to the pixel, and its slot that holds the pixel.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Incoming(u16);

impl Incoming {
    /// `slot` of the factor at (dx, dy) from the pixel, each in -3 ..= 3.
    #[must_use]
    #[inline]
    pub fn new(dx: i32, dy: i32, slot: usize) -> Self {
        Self(((dx + RADIUS) | (dy + RADIUS) << 3 | (slot as i32) << 6) as u16)
    }

    /// The same factor's `slot`, for an entry of slot 0.
    #[inline(always)]
    fn in_slot(self, slot: u16) -> Self {
        Self(self.0 | slot << 6)
    }

    /// (dx, dy, slot) of [`Self::new`].
    #[must_use]
    #[inline(always)]
    pub fn parts(self) -> (isize, isize, usize) {
        let (bits, radius) = (isize::from(self.0.cast_signed()), RADIUS as isize);
        ((bits & 7) - radius, (bits >> 3 & 7) - radius, (bits >> 6).cast_unsigned())
    }
}

/// (dx, dy) of the member with this `code`: its position in the window, in raster order.
#[must_use]
pub(crate) fn offset(code: u8) -> (i32, i32) {
    let code = i32::from(code);
    (code % GRAPH_WINDOW as i32 - RADIUS, code / GRAPH_WINDOW as i32 - RADIUS)
}

/// (dx, dy) of all codes.
fn offsets() -> impl Iterator<Item = (i32, i32)> {
    (0..(GRAPH_WINDOW * GRAPH_WINDOW) as u8).map(offset)
}

/// The code of the member at (dx, dy), each in -3 ..= 3.
#[must_use]
pub fn code(dx: i32, dy: i32) -> u8 {
    ((dy + RADIUS) * GRAPH_WINDOW as i32 + dx + RADIUS) as u8
}

impl LevelGraph {
    /// Builds a graph from the codes of each factor's neighbours: `neighbours` per pixel, pixels in raster
    /// order. Slot 0 of every factor is its own pixel and has no code. No factor has a neighbour twice.
    ///
    /// # Panics
    /// When a code points outside the image or the window, or the number of codes is not `width * height *
    /// neighbours`.
    #[must_use]
    pub fn new(width: usize, height: usize, neighbours: usize, codes: Vec<u8>) -> Self {
        assert_eq!(
            codes.len(),
            width * height * neighbours,
            "{neighbours} codes for each of {width} x {height} pixels"
        );
        let offsets: Vec<(i32, i32)> = offsets().collect();
        for (slot, &code) in codes.iter().enumerate().filter(|slot| *slot.1 != NO_MEMBER) {
            let factor = slot / neighbours;
            let (x, y) = (factor % width, factor / width);
            let inside = offsets.get(usize::from(code)).is_some_and(|&(dx, dy)| {
                x.wrapping_add_signed(dx as isize) < width && y.wrapping_add_signed(dy as isize) < height
            });
            assert!(inside, "factor ({x}, {y}): member code {code} leads out of the image");
        }
        Self::from_valid(width, height, neighbours, codes)
    }

    /// Like [`Self::new`], without checking the codes.
    fn from_valid(width: usize, height: usize, neighbours: usize, codes: Vec<u8>) -> Self {
        let step = |(dx, dy): (i32, i32)| dy as isize * width as isize + dx as isize;
        let steps = offsets().map(step).collect();
        let mut graph =
            Self { width, height, neighbours, codes, steps, starts: Vec::new(), incoming: Vec::new() };
        (graph.starts, graph.incoming) = graph.transposed();
        graph
    }

    /// The transposed table: where the entries of each pixel start (one more than there are pixels), and the entries.
    #[cfg_attr(
        target_arch = "wasm32",
        expect(clippy::needless_for_each, reason = "one thread has plain iterators")
    )]
    fn transposed(&self) -> (Vec<u32>, Vec<Incoming>) {
        let (pixels, band) = (self.width * self.height, BAND * self.width);
        let of_band = |i: usize| i * band..((i + 1) * band).min(pixels);
        let mut starts = vec![0; pixels + 1];
        starts[1..].par_chunks_mut(band).enumerate().for_each(|(i, counts)| {
            self.each_member(&of_band(i), |pixel, _| counts[pixel] += 1);
        });
        for pixel in 0..pixels {
            starts[pixel + 1] += starts[pixel];
        }
        let mut incoming = vec![Incoming::default(); starts[pixels] as usize];
        let mut rest = &mut incoming[..];
        let mut bands = Vec::new();
        for own in (0..pixels.div_ceil(band)).map(of_band) {
            let (entries, after) = rest.split_at_mut((starts[own.end] - starts[own.start]) as usize);
            bands.push((own, entries));
            rest = after;
        }
        bands.into_par_iter().for_each(|(own, entries)| {
            let first = starts[own.start];
            let mut next: Vec<u32> = starts[own.clone()].iter().map(|start| start - first).collect();
            self.each_member(&own, |pixel, entry| {
                entries[next[pixel] as usize] = entry;
                next[pixel] += 1;
            });
        });
        (starts, incoming)
    }

    /// Calls `with` for every slot that holds one of `pixels`, with the index of the pixel among them.
    #[inline(always)]
    fn each_member(&self, pixels: &Range<usize>, mut with: impl FnMut(usize, Incoming)) {
        // By code: the step to the member, which leaves the image for an empty slot, and the entry of slot 0.
        let mut steps = [isize::MIN / 2; 1 << u8::BITS];
        let mut entries = [Incoming::default(); 1 << u8::BITS];
        for ((step, entry), (&to, (dx, dy))) in
            steps.iter_mut().zip(&mut entries).zip(self.steps.iter().zip(offsets()))
        {
            (*step, *entry) = (to, Incoming::new(-dx, -dy, 0));
        }
        let reach = RADIUS as usize * self.width;
        let factors = pixels.start.saturating_sub(reach)..(pixels.end + reach).min(self.width * self.height);
        for factor in factors {
            let own = factor.wrapping_sub(pixels.start);
            if own < pixels.len() {
                with(own, Incoming::new(0, 0, 0));
            }
            let codes = &self.codes[factor * self.neighbours..][..self.neighbours];
            for (slot, &code) in (1..).zip(codes) {
                let member = own.wrapping_add_signed(steps[usize::from(code)]);
                if member < pixels.len() {
                    with(member, entries[usize::from(code)].in_slot(slot));
                }
            }
        }
    }

    /// Width of the level in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height of the level in pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Members of a factor, missing ones included: its pixel and its neighbours.
    #[must_use]
    pub fn slots(&self) -> usize {
        self.neighbours + 1
    }

    /// The pixel in `slot` of `factor`, both as raster indices; `None` where the slot is empty.
    #[must_use]
    pub fn member(&self, factor: usize, slot: usize) -> Option<usize> {
        let Some(slot) = slot.checked_sub(1) else { return Some(factor) };
        let code = usize::from(self.codes[factor * self.neighbours + slot]);
        self.steps.get(code).map(|&step| factor.wrapping_add_signed(step))
    }

    /// Codes of the neighbours of the factor at (x, y).
    #[must_use]
    #[inline]
    pub fn neighbours_of(&self, x: usize, y: usize) -> &[u8] {
        &self.codes[(y * self.width + x) * self.neighbours..][..self.neighbours]
    }

    /// Codes of the neighbours of all factors, `slots() - 1` per pixel.
    #[must_use]
    pub fn codes(&self) -> &[u8] {
        &self.codes
    }

    /// The slots that hold `pixel`, factors in raster order.
    #[must_use]
    #[inline]
    pub fn incoming_of(&self, pixel: usize) -> &[Incoming] {
        &self.incoming[self.starts[pixel] as usize..self.starts[pixel + 1] as usize]
    }
}

/// Weight of a squared pixel of distance relative to a squared quarter level of colour difference.
pub(crate) fn spatial_weight(method: &Method) -> u32 {
    // Intensities 0 ..= 1 are 0 ..= 1020 quarters of an 8-bit level.
    let ratio = method.graph.sigma_range * 1020.0 / method.graph.sigma_space;
    (ratio * ratio + 0.5).floor().min(f64::from(1u32 << 20)) as u32
}

/// Pixels of a row whose neighbours are chosen together.
const LANES: usize = 32;
/// Candidates for the neighbours of a pixel.
const AROUND: usize = GRAPH_WINDOW * GRAPH_WINDOW - 1;

/// The keys of all candidates of [`LANES`] adjacent pixels, aligned to cache lines.
#[repr(align(64))]
struct Keys([[i32; LANES]; AROUND]);

/// The offsets of the window without its centre, by distance, then in raster order, which breaks ties.
pub(crate) fn by_distance() -> Vec<(i32, i32)> {
    let mut window: Vec<(i32, i32)> = offsets().filter(|&o| o != (0, 0)).collect();
    window.sort_by_key(|&(dx, dy)| dx * dx + dy * dy);
    window
}

/// Bits of a key that hold the neighbour's rank; the other bits hold its distance, below 2^25.
pub(crate) const RANK_BITS: u32 = 6;
/// The key of a pixel that cannot be a neighbour; all other keys are smaller.
pub(crate) const NO_KEY: i32 = i32::MAX;

/// The graph of the level whose guide is `image`.
#[must_use]
pub fn of_level(image: &Image, plan: &Plan) -> LevelGraph {
    let (width, height) = image.pixels.size();
    let neighbours = plan.neighbours;
    let guide = Guide {
        network: Network::new(neighbours),
        window: by_distance(),
        weight: spatial_weight(&plan.method),
        channels: [0, 1, 2].map(|c| padded(&image.pixels, 0, |pixel| pixel[c])),
        masked: padded(&image.masked, NO_KEY, |&masked| if masked { NO_KEY } else { 0 }),
    };
    let mut codes = vec![NO_MEMBER; width * height * neighbours];
    if neighbours > 0 {
        codes.par_chunks_mut(width * neighbours).enumerate().for_each_init(
            || Keys([[0; LANES]; AROUND]),
            |keys, (y, row)| {
                choose_row(&guide, y, keys, row);
                for (codes, _) in
                    row.chunks_exact_mut(neighbours).zip(image.masked.row(y)).filter(|own| *own.1)
                {
                    codes.fill(NO_MEMBER);
                }
            },
        );
    }
    LevelGraph::from_valid(width, height, neighbours, codes)
}

/// Converts a plane, and pads its rows with `beyond`: [`RADIUS`] values at the start, and [`RADIUS`] +
/// [`LANES`] at the end.
fn padded<T: Sync, U: Copy + Send + Sync>(
    plane: &Plane<T>,
    beyond: U,
    convert: impl Fn(&T) -> U + Sync,
) -> Plane<U> {
    let (width, height) = plane.size();
    let margin = RADIUS as usize;
    let pitch = width + 2 * margin + LANES;
    let mut data = vec![beyond; pitch * height];
    data.par_chunks_mut(pitch).enumerate().for_each(|(y, row)| {
        for (out, value) in row[margin..].iter_mut().zip(plane.row(y)) {
            *out = convert(value);
        }
    });
    Plane::new(pitch, height, data)
}

/// The data that the neighbours are chosen by, in one plane per channel for vector instructions.
struct Guide {
    network: Network,
    /// The offsets of the window, nearest first.
    window: Vec<(i32, i32)>,
    /// Weight of a squared pixel of distance.
    weight: u32,
    channels: [Plane<u16>; 3],
    /// [`NO_KEY`] where masked or outside, else 0.
    masked: Plane<i32>,
}

/// A network that finds the smallest of [`AROUND`] keys in order, with half the comparisons of insertions one
/// by one. It searches both halves in the same way, and joins the results by Batcher's odd-even merge.
/// Comparisons that do not affect the smallest keys are dropped.
struct Network {
    /// Places to compare and exchange so that the first holds the smaller key, one pair after the other.
    pairs: Vec<(u8, u8)>,
    /// The places that hold the smallest keys afterwards, in order.
    smallest: Vec<u8>,
}

impl Network {
    /// A network for the `count` smallest keys.
    fn new(count: usize) -> Self {
        let mut all = Vec::new();
        let places: Vec<u8> = (0..AROUND as u8).collect();
        let smallest = Self::select(&places, count, &mut all);
        let mut matter = [false; AROUND];
        for &place in &smallest {
            matter[usize::from(place)] = true;
        }
        let mut pairs: Vec<(u8, u8)> = Vec::new();
        for &(a, b) in all.iter().rev() {
            if matter[usize::from(a)] || matter[usize::from(b)] {
                (matter[usize::from(a)], matter[usize::from(b)]) = (true, true);
                pairs.push((a, b));
            }
        }
        pairs.reverse();
        Self { pairs, smallest }
    }

    /// The places of the `count` smallest keys among `places`, after the comparisons that it adds to `pairs`.
    fn select(places: &[u8], count: usize, pairs: &mut Vec<(u8, u8)>) -> Vec<u8> {
        if places.len() == 1 {
            return places[..count.min(1)].to_vec();
        }
        let (first, second) = places.split_at(places.len().next_power_of_two() / 2);
        let sorted = [first, second].map(|half| Self::select(half, count, pairs));
        let mut merged = Self::merge(&sorted[0], &sorted[1], pairs);
        merged.truncate(count);
        merged
    }

    /// Merges sorted places.
    fn merge(a: &[u8], b: &[u8], pairs: &mut Vec<(u8, u8)>) -> Vec<u8> {
        if a.is_empty() || b.is_empty() {
            return [a, b].concat();
        }
        if let (&[a], &[b]) = (a, b) {
            pairs.push((a, b));
            return vec![a, b];
        }
        let every_second =
            |first: usize| [a, b].map(|side| side.iter().skip(first).step_by(2).copied().collect::<Vec<_>>());
        let [even, odd] = [0, 1].map(|first| {
            let [a, b] = every_second(first);
            Self::merge(&a, &b, pairs)
        });
        let mut merged = vec![even[0]];
        for i in 0..odd.len().max(even.len() - 1) {
            let next = [odd.get(i).copied(), even.get(i + 1).copied()];
            if let [Some(a), Some(b)] = next {
                pairs.push((a, b));
            }
            merged.extend(next.into_iter().flatten());
        }
        merged
    }
}

/// Chooses the neighbours of all pixels of row `y`.
#[pulp::with_simd(choose_row = crate::vectors::widest())]
#[inline(always)]
fn choose_row_on<'a, S: pulp::Simd>(_: S, guide: &'a Guide, y: usize, keys: &'a mut Keys, row: &'a mut [u8]) {
    let Guide { network, window, .. } = guide;
    let neighbours = network.smallest.len();
    // Codes by rank.
    let mut codes = [NO_MEMBER; 1 << RANK_BITS];
    for (code_of, &(dx, dy)) in codes.iter_mut().zip(window) {
        *code_of = code(dx, dy);
    }
    for (tile, row) in row.chunks_mut(LANES * neighbours).enumerate() {
        offer(guide, tile * LANES, y, keys);
        let keys = &mut keys.0;
        for &(a, b) in &network.pairs {
            let (a, b) = (usize::from(a), usize::from(b));
            let (first, second) = (keys[a], keys[b]);
            keys[a] = each_lane(|i| first[i].min(second[i]));
            keys[b] = each_lane(|i| first[i].max(second[i]));
        }
        for (slot, &place) in network.smallest.iter().enumerate() {
            for (out, key) in row[slot..].iter_mut().step_by(neighbours).zip(&keys[usize::from(place)]) {
                *out = codes[*key as usize % codes.len()];
            }
        }
    }
}

/// Computes the keys of all candidates for the pixels of row `y` from column `x` on: distance and rank.
#[inline(always)]
fn offer(guide: &Guide, x: usize, y: usize, keys: &mut Keys) {
    let Guide { window, weight, channels, masked, .. } = guide;
    let centre = x + RADIUS as usize;
    let [r, g, b] = channels.each_ref().map(|channel| -> &[u16; LANES] { lanes(channel.row(y), centre) });
    for ((rank, &(dx, dy)), keys) in window.iter().enumerate().zip(&mut keys.0) {
        let Some(ny) = y.checked_add_signed(dy as isize).filter(|&ny| ny < masked.height()) else {
            *keys = [NO_KEY; LANES];
            continue;
        };
        let at = centre.wrapping_add_signed(dx as isize);
        let distance = weight * (dx * dx + dy * dy) as u32;
        let base = (distance << RANK_BITS | rank as u32) as i32;
        let [red, green, blue] = channels;
        let [r, g, b] = [
            squared(r, lanes(red.row(ny), at)),
            squared(g, lanes(green.row(ny), at)),
            squared(b, lanes(blue.row(ny), at)),
        ];
        let masked = lanes(masked.row(ny), at);
        *keys = each_lane(|i| (base + ((r[i] + g[i] + b[i]) << RANK_BITS)) | masked[i]);
    }
}

/// Squared differences, in quarters of an 8-bit level.
#[inline(always)]
fn squared(here: &[u16; LANES], there: &[u16; LANES]) -> [i32; LANES] {
    let apart: [i16; LANES] = each_lane(|i| (here[i].abs_diff(there[i]) >> 6) as i16);
    each_lane(|i| i32::from(apart[i]) * i32::from(apart[i]))
}

/// [`LANES`] values of a padded row.
#[inline(always)]
fn lanes<T>(row: &[T], at: usize) -> &[T; LANES] {
    row[at..].first_chunk().expect("rows are padded")
}

/// The values of `lane` at 0 .. `LANES`, always inlined.
#[inline(always)]
fn each_lane<T: Copy + Default>(mut lane: impl FnMut(usize) -> T) -> [T; LANES] {
    let mut lanes = [T::default(); LANES];
    for (i, out) in lanes.iter_mut().enumerate() {
        *out = lane(i);
    }
    lanes
}
