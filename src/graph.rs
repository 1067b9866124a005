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
    // By distance, then in raster order: a stable choice of the smallest keys breaks ties as promised.
    let mut window: Vec<(i32, i32)> =
        (0..(GRAPH_WINDOW * GRAPH_WINDOW) as u8).map(offset).filter(|&o| o != (0, 0)).collect();
    window.sort_by_key(|&(dx, dy)| dx * dx + dy * dy);
    let mut codes = vec![NO_MEMBER; width * height * neighbours];
    if neighbours > 0 {
        codes.par_chunks_mut(width * neighbours).enumerate().for_each(|(y, row)| {
            let mut candidates: Vec<(u64, u8)> = Vec::with_capacity(window.len());
            for (x, out) in row.chunks_exact_mut(neighbours).enumerate() {
                if image.masked[(x, y)] {
                    continue;
                }
                let centre = &image.pixels[(x, y)];
                candidates.clear();
                for (order, &(dx, dy)) in window.iter().enumerate() {
                    let (nx, ny) = (x as i32 + dx, y as i32 + dy);
                    if nx < 0 || ny < 0 || nx >= width as i32 || ny >= height as i32 {
                        continue;
                    }
                    let at = (nx as usize, ny as usize);
                    if image.masked[at] {
                        continue;
                    }
                    let key =
                        colour_distance(centre, &image.pixels[at]) + weight * (dx * dx + dy * dy) as u32;
                    candidates.push((u64::from(key) << 8 | order as u64, code(dx, dy)));
                }
                if candidates.len() > neighbours {
                    candidates.select_nth_unstable(neighbours - 1);
                    candidates.truncate(neighbours);
                }
                candidates.sort_unstable();
                for (slot, &(_, code)) in out.iter_mut().zip(&candidates) {
                    *slot = code;
                }
            }
        });
    }
    LevelGraph::new(width, height, neighbours, codes)
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
