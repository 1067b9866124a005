//! Matching cost of level 0: see [`crate::backend::Stage::Cost`].

use crate::image::{Image, Pair, Pixel};
use crate::options::Cost;
use crate::plan::{CENSUS_BIT_COST, CENSUS_BITS, CENSUS_PLACES, COLOUR_MOST, COST_MAX, Plan};
use rayon::prelude::*;

const CENSUS_X: isize = 4;
const CENSUS_Y: isize = 3;

pub(super) fn run(plan: &Plan, pair: &Pair, out: &mut [u8]) {
    match plan.method.cost {
        Cost::Census | Cost::AdCensus => census(plan, pair, out),
        Cost::Sad => sad(plan, pair, out),
    }
}

fn difference(a: Pixel, b: Pixel) -> u32 {
    (0..3).map(|c| u32::from(a[c].abs_diff(b[c]))).sum()
}

/// A row of the right image from right to left, so that ascending labels are side by side.
struct Reversed {
    channels: [Vec<u16>; 3],
    census: Vec<[u32; 2]>,
    masked: Vec<bool>,
}

impl Reversed {
    fn new(width: usize) -> Self {
        Self {
            channels: [0, 1, 2].map(|_| vec![0; width]),
            census: vec![[0; 2]; width],
            masked: vec![false; width],
        }
    }

    fn fill(&mut self, pixels: &[Pixel], census: &[[u32; 2]], masked: &[bool]) {
        for (c, channel) in self.channels.iter_mut().enumerate() {
            for (out, pixel) in channel.iter_mut().zip(pixels.iter().rev()) {
                *out = pixel[c];
            }
        }
        self.census.iter_mut().zip(census.iter().rev()).for_each(|(out, &c)| *out = c);
        self.masked.iter_mut().zip(masked.iter().rev()).for_each(|(out, &m)| *out = m);
    }
}

fn census(plan: &Plan, pair: &Pair, out: &mut [u8]) {
    let level = &plan.levels[0];
    let (left, right) = (pair.left(), pair.right());
    let (left_census, right_census) = (census_bits(left), census_bits(right));
    let width = level.width;
    out.par_chunks_mut(width * level.stride).enumerate().for_each_init(
        || (Reversed::new(width), vec![0; width]),
        |(reversed, weights), (y, row)| {
            colour_weights(plan, left, y, weights);
            let of_row = y * width..(y + 1) * width;
            reversed.fill(right.pixels.row(y), &right_census[of_row.clone()], right.masked.row(y));
            let (pixels, census) = (left.pixels.row(y), &left_census[of_row]);
            for (x, costs) in row.chunks_exact_mut(level.stride).enumerate() {
                costs.fill(plan.outside_cost);
                // x - d is inside for first <= label index < end.
                let first = (x as i64 - (width as i64 - 1) - i64::from(level.min)).max(0);
                let end = (x as i64 - i64::from(level.min) + 1).min(level.labels as i64);
                if left.masked[(x, y)] || first >= end {
                    continue;
                }
                let start = (width as i64 - 1 - x as i64 + i64::from(level.min) + first) as usize;
                let costs = &mut costs[first as usize..end as usize];
                pixel_costs(pixels[x], census[x], weights[x], reversed, start, plan.outside_cost, costs);
            }
        },
    );
}

/// The costs of a left pixel against those of the right row from `start` on.
fn pixel_costs(
    pixel: Pixel,
    census: [u32; 2],
    weight: u32,
    right: &Reversed,
    start: usize,
    outside: u8,
    costs: &mut [u8],
) {
    let seen = start..start + costs.len();
    for (cost, other) in costs.iter_mut().zip(&right.census[seen.clone()]) {
        let bits = (census[0] ^ other[0]).count_ones() + (census[1] ^ other[1]).count_ones();
        *cost = (CENSUS_BIT_COST * bits.min(CENSUS_BITS)) as u8;
    }
    if weight > 0 {
        let [r, g, b] = right.channels.each_ref().map(|channel| &channel[seen.clone()]);
        for (cost, ((&r, &g), &b)) in costs.iter_mut().zip(r.iter().zip(g).zip(b)) {
            let apart = |a: u16, b: u16| u32::from(a.abs_diff(b));
            let sum = apart(pixel[0], r) + apart(pixel[1], g) + apart(pixel[2], b);
            let colour = (sum >> 8).min(COLOUR_MOST);
            *cost += ((weight * colour + COLOUR_MOST / 2) / COLOUR_MOST) as u8;
        }
    }
    for (cost, &masked) in costs.iter_mut().zip(&right.masked[seen]) {
        *cost = if masked { outside } else { *cost };
    }
}

/// Calls `see` with every place (dx, dy) of the window around the pixels of row `y`, and what `value` is there for each of
/// them, places clamped to the image: a row at once is a vector.
fn around<T: Copy>(
    (width, height): (usize, usize),
    y: usize,
    value: impl Fn(usize, usize) -> T,
    mut see: impl FnMut(isize, isize, &[T]),
) {
    let clamp = |v: isize, size: usize| v.clamp(0, size as isize - 1) as usize;
    let mut padded = Vec::with_capacity(width + 2 * CENSUS_X as usize);
    for dy in -CENSUS_Y..=CENSUS_Y {
        let ny = clamp(y as isize + dy, height);
        padded.clear();
        padded.extend((-CENSUS_X..width as isize + CENSUS_X).map(|x| value(clamp(x, width), ny)));
        for dx in -CENSUS_X..=CENSUS_X {
            see(dx, dy, &padded[(dx + CENSUS_X) as usize..][..width]);
        }
    }
}

/// The census of every pixel: a bit for each other place of the window, those before the pixel and those after it in
/// halves of their own.
fn census_bits(image: &Image) -> Vec<[u32; 2]> {
    let (width, height) = image.pixels.size();
    // A masked pixel is below nobody.
    let grey = |x: usize, y: usize| if image.masked[(x, y)] { u16::MAX } else { image.pixels[(x, y)][3] };
    let mut out = vec![[0; 2]; width * height];
    out.par_chunks_mut(width).enumerate().for_each_init(
        || [vec![0u32; width], vec![0u32; width], vec![0u32; width]],
        |[centre, before, after], (y, row)| {
            for ((centre, pixel), sums) in
                centre.iter_mut().zip(image.pixels.row(y)).zip(before.iter_mut().zip(after.iter_mut()))
            {
                *centre = pixel[3].into();
                (*sums.0, *sums.1) = (0, 0);
            }
            around((width, height), y, grey, |dx, dy, greys| {
                let bits = if (dy, dx) < (0, 0) { &mut *before } else { &mut *after };
                if (dy, dx) != (0, 0) {
                    for ((bits, &grey), &centre) in bits.iter_mut().zip(greys).zip(centre.iter()) {
                        *bits = *bits << 1 | u32::from(u32::from(grey) < centre);
                    }
                }
            });
            for (bits, (&before, &after)) in row.iter_mut().zip(before.iter().zip(after.iter())) {
                *bits = [before, after];
            }
        },
    );
    out
}

/// How much colour counts at each pixel of row `y`: by the variance of grey around it.
fn colour_weights(plan: &Plan, image: &Image, y: usize, weights: &mut [u32]) {
    let (full, most) = (plan.colour_weight(), plan.colour_variance());
    if full == 0 || most == 0 {
        weights.fill(full);
        return;
    }
    let width = weights.len();
    let masked_grey = |x: usize, y: usize| {
        (u32::from(image.pixels[(x, y)][3] >> 8), if image.masked[(x, y)] { u32::MAX } else { 0 })
    };
    let (mut sums, mut squares) = (vec![0; width], vec![0; width]);
    let centre: Vec<u32> = image.pixels.row(y).iter().map(|pixel| u32::from(pixel[3] >> 8)).collect();
    around(image.pixels.size(), y, masked_grey, |_, _, greys| {
        let here = sums.iter_mut().zip(squares.iter_mut()).zip(&centre);
        for (((sum, square), &centre), &(grey, masked)) in here.zip(greys) {
            let grey = grey & !masked | centre & masked;
            *sum += grey;
            *square += grey * grey;
        }
    });
    for (weight, (sum, square)) in weights.iter_mut().zip(sums.into_iter().zip(squares)) {
        *weight = full * (CENSUS_PLACES * square - sum * sum).min(most) / most;
    }
}

fn sad(plan: &Plan, pair: &Pair, out: &mut [u8]) {
    let level = &plan.levels[0];
    let (width, height) = (level.width, level.height);
    let radius = plan.method.sad_window as usize / 2;
    let (left, right) = (pair.left(), pair.right());
    out.par_chunks_mut(width * level.stride).enumerate().for_each_init(
        || vec![(0u64, 0u32); width + 1],
        |sums, (y, row)| {
            row.fill(plan.outside_cost);
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
