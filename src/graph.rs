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
use rayon::prelude::*;
use std::ops::Range;

/// The code of a slot that holds no pixel, because the neighbour is outside the image, masked, or missing.
pub const NO_MEMBER: u8 = u8::MAX;
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
    /// Offset of a member from its factor, in raster indices, by code.
    steps: Vec<isize>,
    starts: Vec<u32>,
    incoming: Vec<Incoming>,
}

/// A slot that holds a pixel: the factor's place relative to the pixel, and the slot.
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
pub fn offset(code: u8) -> (i32, i32) {
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
        let pixels = width * height;
        assert_eq!(
            codes.len(),
            pixels * neighbours,
            "{neighbours} codes for each of {width} x {height} pixels"
        );
        let step = |(dx, dy): (i32, i32)| dy as isize * width as isize + dx as isize;
        let steps = offsets().map(step).collect();
        let mut graph =
            Self { width, height, neighbours, codes, steps, starts: Vec::new(), incoming: Vec::new() };
        graph.check();
        (graph.starts, graph.incoming) = graph.transposed();
        graph
    }

    /// Panics when a code points outside the image.
    fn check(&self) {
        if self.neighbours == 0 {
            return;
        }
        let offsets: Vec<(i32, i32)> = offsets().collect();
        let rows = self.codes.par_chunks_exact(self.width * self.neighbours);
        rows.enumerate().for_each(|(y, row)| {
            for (x, codes) in row.chunks_exact(self.neighbours).enumerate() {
                for &code in codes.iter().filter(|&&code| code != NO_MEMBER) {
                    let inside = offsets.get(usize::from(code)).is_some_and(|&(dx, dy)| {
                        x.wrapping_add_signed(dx as isize) < self.width
                            && y.wrapping_add_signed(dy as isize) < self.height
                    });
                    assert!(inside, "factor ({x}, {y}): member code {code} leads out of the image");
                }
            }
        });
    }

    /// The transposed table: where the entries of each pixel start, with one more than there are pixels, and the entries.
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
        let reach = RADIUS as usize * self.width;
        let factors = pixels.start.saturating_sub(reach)..(pixels.end + reach).min(self.width * self.height);
        for factor in factors {
            if pixels.contains(&factor) {
                with(factor - pixels.start, Incoming::new(0, 0, 0));
            }
            let codes = &self.codes[factor * self.neighbours..][..self.neighbours];
            for (slot, &code) in (1..).zip(codes) {
                if let Some(pixel) = self.pixel(factor, code).filter(|pixel| pixels.contains(pixel)) {
                    let (dx, dy) = offset(code);
                    with(pixel - pixels.start, Incoming::new(-dx, -dy, slot));
                }
            }
        }
    }

    /// The pixel of the member `code` of `factor`, both as raster indices.
    #[inline]
    fn pixel(&self, factor: usize, code: u8) -> Option<usize> {
        self.steps.get(usize::from(code)).map(|&step| factor.wrapping_add_signed(step))
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
        match slot {
            0 => Some(factor),
            _ => self.pixel(factor, self.codes[factor * self.neighbours + slot - 1]),
        }
    }

    /// Codes of the neighbours of the factor at (x, y).
    #[must_use]
    #[inline]
    pub fn neighbours_of(&self, x: usize, y: usize) -> &[u8] {
        &self.codes[(y * self.width + x) * self.neighbours..][..self.neighbours]
    }

    /// Codes of all factors' neighbours, `slots() - 1` per pixel.
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

/// The offsets of the window without the centre's, by distance and then in raster order: this rank breaks ties.
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
        window: by_distance(),
        weight: spatial_weight(&plan.method),
        channels: [0, 1, 2].map(|c| {
            let channel = image.pixels.data().par_iter().map(|pixel| pixel[c]);
            Plane::new(width, height, channel.collect())
        }),
        masked: {
            let keys = image.masked.data().par_iter().map(|&masked| if masked { NO_KEY } else { 0 });
            Plane::new(width, height, keys.collect())
        },
    };
    let mut codes = vec![NO_MEMBER; width * height * neighbours];
    if neighbours > 0 {
        codes.par_chunks_mut(width * neighbours).enumerate().for_each_init(
            || (vec![0; width], vec![0; width * neighbours]),
            |(keys, chosen), (y, row)| {
                chosen.fill(NO_KEY);
                choose_row(&guide, y, keys, chosen);
                for (x, out) in row.chunks_exact_mut(neighbours).enumerate() {
                    let found = chosen[x..].iter().step_by(width).filter(|&&key| key != NO_KEY);
                    if !image.masked[(x, y)] {
                        for (out, &key) in out.iter_mut().zip(found) {
                            let (dx, dy) = guide.window[(key & ((1 << RANK_BITS) - 1)) as usize];
                            *out = code(dx, dy);
                        }
                    }
                }
            },
        );
    }
    LevelGraph::new(width, height, neighbours, codes)
}

/// The data that neighbours are chosen by, as planes per channel, so that a whole row is processed with
/// vectors.
struct Guide {
    /// The offsets of the window, nearest first.
    window: Vec<(i32, i32)>,
    /// Weight of a squared pixel of distance.
    weight: u32,
    channels: [Plane<u16>; 3],
    /// [`NO_KEY`] where masked, else 0.
    masked: Plane<i32>,
}

/// Offers every offset of the window to the pixels of row `y`; the smallest keys stay in `chosen`, by slot.
#[pulp::with_simd(choose_row = pulp::Arch::new())]
#[inline(always)]
fn choose_row_on<'a, S: pulp::Simd>(
    _: S,
    guide: &'a Guide,
    y: usize,
    keys: &'a mut [i32],
    chosen: &'a mut [i32],
) {
    let Guide { window, weight, channels, masked } = guide;
    let (width, height) = masked.size();
    let centre = channels.each_ref().map(|channel| channel.row(y));
    for (rank, &(dx, dy)) in window.iter().enumerate() {
        let ny = y as i32 + dy;
        let (first, end) = ((-dx).max(0) as usize, width as i32 - dx.max(0));
        if ny < 0 || ny >= height as i32 || first as i32 >= end {
            continue;
        }
        let (seen, to) = (first..end as usize, (first as i32 + dx) as usize);
        let there = to..to + seen.len();
        let distance = weight * (dx * dx + dy * dy) as u32;
        let base = (distance << RANK_BITS | rank as u32) as i32;
        let keys = &mut keys[seen.clone()];
        let here = centre.map(|channel| &channel[seen.clone()]);
        let others = channels.each_ref().map(|channel| &channel.row(ny as usize)[there.clone()]);
        offer(base, here, others, &masked.row(ny as usize)[there], keys);
        for chosen in chosen.chunks_exact_mut(width) {
            keep_smaller(&mut chosen[seen.clone()], keys);
        }
    }
}

/// The keys of one neighbour for all pixels of a row: `base` plus the squared colour difference.
#[inline(always)]
fn offer(base: i32, here: [&[u16]; 3], others: [&[u16]; 3], masked: &[i32], keys: &mut [i32]) {
    let (here, others) = (here.map(|c| &c[..keys.len()]), others.map(|c| &c[..keys.len()]));
    for ((i, key), &masked) in keys.iter_mut().enumerate().zip(masked) {
        let squared = |c: usize| {
            let difference = i32::from((here[c][i].abs_diff(others[c][i]) >> 6) as i16);
            difference * difference
        };
        *key = (base + ((squared(0) + squared(1) + squared(2)) << RANK_BITS)) | masked;
    }
}

/// Keeps the smaller of each pair in `chosen` and the larger in `keys`.
#[inline(always)]
fn keep_smaller(chosen: &mut [i32], keys: &mut [i32]) {
    for (chosen, key) in chosen.iter_mut().zip(keys) {
        (*chosen, *key) = ((*chosen).min(*key), (*chosen).max(*key));
    }
}

/// The next coarser image: a 5 x 5 binomial low-pass over the unmasked pixels, taken at every second pixel. A
/// coarse pixel is masked when all of its up to 2 x 2 children are.
#[must_use]
pub fn downsample(image: &Image) -> Image {
    const WEIGHTS: [u32; 5] = [1, 4, 6, 4, 1];
    let (width, height) = image.pixels.size();
    let (w, h) = (width.div_ceil(2), height.div_ceil(2));
    let masked = Plane::from_fn(w, h, |x, y| {
        (2 * y..height.min(2 * y + 2))
            .all(|fy| (2 * x..width.min(2 * x + 2)).all(|fx| image.masked[(fx, fy)]))
    });
    let mut pixels = vec![[0; 4]; w * h];
    pixels.par_chunks_mut(w).enumerate().for_each_init(
        // Vertical sums of each column, and the sums of their weights.
        || vec![([0u32; 4], 0u32); width],
        |columns, (y, row)| {
            columns.fill(([0; 4], 0));
            for (j, wy) in WEIGHTS.iter().enumerate() {
                let fy = (2 * y + j).saturating_sub(2).min(height - 1);
                let fine = image.pixels.row(fy).iter().zip(image.masked.row(fy));
                for ((sums, total), (pixel, &masked)) in columns.iter_mut().zip(fine) {
                    let weight = if masked { 0 } else { *wy };
                    sums.iter_mut().zip(pixel).for_each(|(sum, &v)| *sum += weight * u32::from(v));
                    *total += weight;
                }
            }
            for (x, out) in row.iter_mut().enumerate() {
                if masked[(x, y)] {
                    continue;
                }
                let (mut sums, mut total) = ([0u32; 4], 0);
                for (i, wx) in WEIGHTS.iter().enumerate() {
                    let (column, weights) = &columns[(2 * x + i).saturating_sub(2).min(width - 1)];
                    sums.iter_mut().zip(column).for_each(|(sum, &v)| *sum += wx * v);
                    total += wx * weights;
                }
                *out = sums.map(|sum| ((2 * sum + total) / (2 * total)) as u16);
            }
        },
    );
    Image { pixels: Plane::new(w, h, pixels), masked }
}
