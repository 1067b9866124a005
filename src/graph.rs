//! Who depends on whom: the dependency factors S of one level (sections 2.1 and 3.1).
//!
//! There is one factor a pixel. Its members are the pixel and those neighbours in a 7 x 7 window whose bilateral
//! coefficient `exp(-(dx^2 + dy^2) / 2 sigma_d^2 - |colour difference|^2 / 2 sigma_r^2)` reaches the percentile.
//! Only the order of the coefficients matters, so their exponents are compared, in integers, ties by distance and
//! then in raster order: every machine picks the same graph. The centre's own coefficient is always the
//! largest; the percentile is taken over the 48 others (open in the paper).

use crate::image::{Image, Pixel, Plane};
use crate::plan::{GRAPH_WINDOW, Plan};
use rayon::prelude::*;
use std::ops::Range;

/// The code of a slot that no pixel fills: a neighbour outside the image, masked, or simply not there.
pub const NO_MEMBER: u8 = u8::MAX;
const RADIUS: i32 = GRAPH_WINDOW as i32 / 2;

/// The dependency factors of one level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LevelGraph {
    width: usize,
    height: usize,
    neighbours: usize,
    codes: Vec<u8>,
    starts: Vec<u32>,
    incoming: Vec<u32>,
}

/// (dx, dy) of a member `code`: its place in the window, in raster order.
#[must_use]
pub fn offset(code: u8) -> (i32, i32) {
    let code = i32::from(code);
    (code % GRAPH_WINDOW as i32 - RADIUS, code / GRAPH_WINDOW as i32 - RADIUS)
}

/// The code of the member at (dx, dy), each -3 ..= 3.
#[must_use]
pub fn code(dx: i32, dy: i32) -> u8 {
    ((dy + RADIUS) * GRAPH_WINDOW as i32 + dx + RADIUS) as u8
}

impl LevelGraph {
    /// A graph from the codes of each factor's neighbours: `neighbours` a pixel, pixels in raster order. Slot 0
    /// of every factor is its own pixel and has no code.
    ///
    /// # Panics
    /// When a code leads out of the image or the window, or the number of codes is not `width * height *
    /// neighbours`.
    #[must_use]
    pub fn new(width: usize, height: usize, neighbours: usize, codes: Vec<u8>) -> Self {
        let pixels = width * height;
        assert_eq!(
            codes.len(),
            pixels * neighbours,
            "{neighbours} codes for each of {width} x {height} pixels"
        );
        let slots = neighbours + 1;
        let mut graph =
            Self { width, height, neighbours, codes, starts: vec![0; pixels + 1], incoming: Vec::new() };
        for factor in 0..pixels {
            for slot in 0..slots {
                if let Some(pixel) = graph.member(factor, slot) {
                    graph.starts[pixel + 1] += 1;
                }
            }
        }
        for pixel in 0..pixels {
            graph.starts[pixel + 1] += graph.starts[pixel];
        }
        let mut next = graph.starts.clone();
        graph.incoming = vec![0; graph.starts[pixels] as usize];
        for factor in 0..pixels {
            for slot in 0..slots {
                if let Some(pixel) = graph.member(factor, slot) {
                    graph.incoming[next[pixel] as usize] = (factor * slots + slot) as u32;
                    next[pixel] += 1;
                }
            }
        }
        graph
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

    /// Members of a factor, filled or not: its pixel and its neighbours.
    #[must_use]
    pub fn slots(&self) -> usize {
        self.neighbours + 1
    }

    /// The pixel in `slot` of `factor`, both pixels as raster indices; `None` where no pixel fills it.
    ///
    /// # Panics
    /// When the member is outside the image, which [`LevelGraph::new`] has ruled out.
    #[must_use]
    pub fn member(&self, factor: usize, slot: usize) -> Option<usize> {
        if slot == 0 {
            return Some(factor);
        }
        let code = self.codes[factor * self.neighbours + slot - 1];
        if code == NO_MEMBER {
            return None;
        }
        let (dx, dy) = offset(code);
        let x = (factor % self.width) as i32 + dx;
        let y = (factor / self.width) as i32 + dy;
        assert!(
            x >= 0 && y >= 0 && x < self.width as i32 && y < self.height as i32 && dy <= RADIUS,
            "factor {factor}: member code {code} leads out of the image"
        );
        Some(y as usize * self.width + x as usize)
    }

    /// Codes of all factors' neighbours, `slots() - 1` a pixel.
    #[must_use]
    pub fn codes(&self) -> &[u8] {
        &self.codes
    }

    /// Where each pixel's entries start in [`Self::incoming`]; one more entry than pixels.
    #[must_use]
    pub fn starts(&self) -> &[u32] {
        &self.starts
    }

    /// The transposed table: for each pixel the slots that hold it, as factor * slots + slot, ascending.
    #[must_use]
    pub fn incoming(&self) -> &[u32] {
        &self.incoming
    }

    /// The slots that hold `pixel`, as factor * slots + slot.
    #[must_use]
    pub fn incoming_of(&self, pixel: usize) -> &[u32] {
        &self.incoming[self.starts[pixel] as usize..self.starts[pixel + 1] as usize]
    }
}

/// The graphs of all levels of `plan`, from the reference image.
#[must_use]
pub fn build(image: &Image, plan: &Plan) -> Vec<LevelGraph> {
    let weight = spatial_weight(plan.method.sigma_space, plan.method.sigma_range);
    let mut graphs = Vec::with_capacity(plan.levels.len());
    let mut level = image.clone();
    for z in 0..plan.levels.len() {
        if z > 0 {
            level = downsample(&level);
        }
        graphs.push(level_graph(&level, plan.neighbours, weight));
    }
    graphs
}

/// What a squared pixel of distance weighs against a squared 1/16 level of colour difference.
fn spatial_weight(sigma_space: f64, sigma_range: f64) -> u32 {
    // Intensities 0 ..= 1 are 0 ..= 4080 sixteenths of an 8-bit level.
    let ratio = sigma_range * 4080.0 / sigma_space;
    (ratio * ratio + 0.5).floor().min(f64::from(1u32 << 26)) as u32
}

/// Squared colour difference in sixteenths of an 8-bit level; below 2^26.
#[must_use]
pub fn colour_distance(a: &Pixel, b: &Pixel) -> u32 {
    (0..3)
        .map(|c| {
            let difference = u32::from(a[c].abs_diff(b[c])) >> 4;
            difference * difference
        })
        .sum()
}

fn level_graph(image: &Image, neighbours: usize, weight: u32) -> LevelGraph {
    let (width, height) = image.pixels.size();
    // By distance, then in raster order: of equal keys the first one found stays, which breaks ties as promised.
    let mut window: Vec<(i32, i32)> =
        (0..(GRAPH_WINDOW * GRAPH_WINDOW) as u8).map(offset).filter(|&o| o != (0, 0)).collect();
    window.sort_by_key(|&(dx, dy)| dx * dx + dy * dy);
    // Channel by channel, and row by row below: a row at once is a vector.
    let channels = [0, 1, 2].map(|c| image.pixels.map(|pixel| pixel[c]));
    let masked = image.masked.map(|&masked| if masked { NO_KEY } else { 0 });
    let mut codes = vec![NO_MEMBER; width * height * neighbours];
    if neighbours > 0 {
        codes.par_chunks_mut(width * neighbours).enumerate().for_each_init(
            || Chosen::new(width, neighbours),
            |chosen, (y, row)| {
                chosen.clear();
                let centre = channels.each_ref().map(|channel| channel.row(y));
                for &(dx, dy) in &window {
                    let ny = y as i32 + dy;
                    let (first, end) = ((-dx).max(0) as usize, width as i32 - dx.max(0));
                    if ny < 0 || ny >= height as i32 || first as i32 >= end {
                        continue;
                    }
                    let (seen, to) = (first..end as usize, (first as i32 + dx) as usize);
                    let there = to..to + seen.len();
                    let other = channels.each_ref().map(|channel| &channel.row(ny as usize)[there.clone()]);
                    let distance = (weight * (dx * dx + dy * dy) as u32) as i32;
                    let keys = &mut chosen.key[seen.clone()];
                    keys.fill(distance);
                    for (here, other) in centre.iter().zip(other) {
                        for (key, (&a, &b)) in keys.iter_mut().zip(here[seen.clone()].iter().zip(other)) {
                            let difference = i32::from(a.abs_diff(b) >> 4);
                            *key += difference * difference;
                        }
                    }
                    for (key, masked) in keys.iter_mut().zip(&masked.row(ny as usize)[there]) {
                        *key |= masked;
                    }
                    chosen.offer(seen, code(dx, dy));
                }
                for (x, out) in row.chunks_exact_mut(neighbours).enumerate() {
                    if !image.masked[(x, y)] {
                        for (slot, out) in out.iter_mut().enumerate() {
                            *out = chosen.codes[slot * width + x] as u8;
                        }
                    }
                }
            },
        );
    }
    LevelGraph::new(width, height, neighbours, codes)
}

/// The key of what is no neighbour; every other one is below it.
const NO_KEY: i32 = i32::MAX;

/// The neighbours with the smallest keys so far of all pixels of a row, \[slot\]\[x\], ascending.
struct Chosen {
    keys: Vec<i32>,
    codes: Vec<i32>,
    /// Key and code on offer to each pixel.
    key: Vec<i32>,
    code: Vec<i32>,
    /// 1 where what is on offer has been in the slot before: then it goes before an equal key.
    moved: Vec<i32>,
}

impl Chosen {
    fn new(width: usize, neighbours: usize) -> Self {
        Self {
            keys: vec![NO_KEY; width * neighbours],
            codes: vec![NO_MEMBER.into(); width * neighbours],
            key: vec![0; width],
            code: vec![0; width],
            moved: vec![0; width],
        }
    }

    fn clear(&mut self) {
        self.keys.fill(NO_KEY);
        self.codes.fill(NO_MEMBER.into());
    }

    /// Offers the neighbour `code`, by the keys on offer, to the pixels `seen`: it takes the place of the first one with a
    /// larger key, that one the place of the next, and so on.
    fn offer(&mut self, seen: Range<usize>, code: u8) {
        let width = self.key.len();
        let (offered, carried) = (&mut self.key[seen.clone()], &mut self.code[seen.clone()]);
        let moved = &mut self.moved[seen.clone()];
        carried.fill(code.into());
        moved.fill(0);
        let slots = self.keys.chunks_exact_mut(width).zip(self.codes.chunks_exact_mut(width));
        for (keys, codes) in slots {
            let held = keys[seen.clone()].iter_mut().zip(&mut codes[seen.clone()]);
            let offer = offered.iter_mut().zip(carried.iter_mut()).zip(moved.iter_mut());
            for ((held, held_code), ((key, code), moved)) in held.zip(offer) {
                let smaller = *key - *moved < *held;
                let (old, old_code) = (*held, *held_code);
                *held = if smaller { *key } else { old };
                *held_code = if smaller { *code } else { old_code };
                *key = if smaller { old } else { *key };
                *code = if smaller { old_code } else { *code };
                *moved = i32::from(smaller);
            }
        }
    }
}

/// The next coarser image: 5 x 5 binomial low-pass over the unmasked pixels, every second pixel. A coarse pixel
/// is masked when its up to 2 x 2 children all are.
#[must_use]
pub fn downsample(image: &Image) -> Image {
    const WEIGHTS: [u32; 5] = [1, 4, 6, 4, 1];
    let (width, height) = image.pixels.size();
    let (w, h) = (width.div_ceil(2), height.div_ceil(2));
    let masked = Plane::from_fn(w, h, |x, y| {
        (2 * y..height.min(2 * y + 2))
            .all(|fy| (2 * x..width.min(2 * x + 2)).all(|fx| image.masked[(fx, fy)]))
    });
    let rows: Vec<Vec<Pixel>> = (0..h)
        .into_par_iter()
        .map(|y| {
            (0..w)
                .map(|x| {
                    if masked[(x, y)] {
                        return [0; 4];
                    }
                    let (mut sums, mut total) = ([0u32; 4], 0);
                    for (j, wy) in WEIGHTS.iter().enumerate() {
                        let fy = (2 * y + j).saturating_sub(2).min(height - 1);
                        for (i, wx) in WEIGHTS.iter().enumerate() {
                            let fx = (2 * x + i).saturating_sub(2).min(width - 1);
                            if !image.masked[(fx, fy)] {
                                total += wx * wy;
                                for (sum, &v) in sums.iter_mut().zip(&image.pixels[(fx, fy)]) {
                                    *sum += wx * wy * u32::from(v);
                                }
                            }
                        }
                    }
                    sums.map(|sum| ((2 * sum + total) / (2 * total)) as u16)
                })
                .collect()
        })
        .collect();
    Image { pixels: Plane::new(w, h, rows.concat()), masked }
}
