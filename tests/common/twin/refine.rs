use super::Finest;
use mrfgs::image::{Image, Pair, Plane};
use mrfgs::low_level::plan::Plan;

/// Parameters of the fit: the neighbours that count, and the reach.
#[derive(Clone, Copy)]
pub struct Fit {
    /// Columns and rows to either side that count.
    pub window: (i64, i64),
    /// Largest label difference between a neighbour and the centre.
    pub near: i64,
    /// Largest offset from twice the label's disparity, in full-size pixels.
    pub reach: i64,
}

impl Fit {
    pub const DEFINED: Self = Self { window: (2, 1), near: 1, reach: 4 };
}

/// The census of a pixel in raster order; alternating bits outside the image and on masked pixels.
fn census(image: &Image, x: i64, y: i64) -> Vec<bool> {
    let (width, height) = (image.width() as i64, image.height() as i64);
    let inside = x >= 0 && x < width && y >= 0 && y < height;
    if !inside || image.masked[(x as usize, y as usize)] {
        return (0..16).map(|i| i % 2 == 0).collect();
    }
    let own = image.pixels[(x as usize, y as usize)][3];
    let mut bits = Vec::new();
    for v in y - 2..=y + 2 {
        for u in x - 2..=x + 2 {
            let (across, down) = ((u - x).abs(), (v - y).abs());
            let beside = across.max(down) == 1;
            let farther = across.max(down) == 2 && across % 2 == 0 && down % 2 == 0;
            if beside || farther {
                let at = (u.clamp(0, width - 1) as usize, v.clamp(0, height - 1) as usize);
                bits.push(!image.masked[at] && image.pixels[at][3] < own);
            }
        }
    }
    bits
}

/// The disparity of each half-size pixel, in 1/256 px; `pair` has its full size.
pub fn refine(plan: &Plan, pair: &Pair, maps: &mut Finest) {
    refine_by(&Fit::DEFINED, plan, pair, maps);
}

/// Like [`refine`], with other parameters.
pub fn refine_by(fit: &Fit, plan: &Plan, pair: &Pair, maps: &mut Finest) {
    let full = pair.full().unwrap();
    let (width, height) = maps.label.size();
    let all = |image: &Image| Plane::from_fn(2 * width, 2 * height, |x, y| census(image, x as i64, y as i64));
    let (left, right) = (all(full.left()), all(full.right()));
    let nowhere = census(full.right(), -1, 0);
    let cost = |x: usize, y: usize, disparity: i64| {
        let mut count = 0;
        for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let (u, v) = (2 * x + i, 2 * y + j);
            let other = u as i64 - disparity;
            let inside = other >= 0 && other < 2 * width as i64;
            let there = if inside { &right[(other as usize, v)] } else { &nowhere };
            count += left[(u, v)].iter().zip(there).filter(|(a, b)| a != b).count() as i64;
        }
        count
    };
    maps.raw = Plane::from_fn(width, height, |x, y| {
        let label = i64::from(maps.label[(x, y)]);
        let twice = 2 * (i64::from(plan.range.min) + label);
        let sum = |k: i64| {
            let mut sum = 0;
            for v in y as i64 - fit.window.1..=y as i64 + fit.window.1 {
                for u in x as i64 - fit.window.0..=x as i64 + fit.window.0 {
                    if u < 0 || v < 0 || u >= width as i64 || v >= height as i64 {
                        continue;
                    }
                    let at = (u as usize, v as usize);
                    if (i64::from(maps.label[at]) - label).abs() <= fit.near {
                        sum += cost(at.0, at.1, twice + k);
                    }
                }
            }
            sum
        };
        let best = (-fit.reach..=fit.reach).min_by_key(|&k| (sum(k), k.abs(), k)).unwrap();
        let (a, b, c) = (sum(best - 1), sum(best), sum(best + 1));
        let s = a.max(c) - b;
        let offset = if s <= 0 {
            0
        } else {
            (((256 * (a - c) + s) as f64 / (2 * s) as f64).floor() as i64).clamp(-256, 256)
        };
        ((256 * (twice + best) + offset + 1) as f64 / 2.0).floor() as i32
    });
    maps.disparity = maps.raw.clone();
}
