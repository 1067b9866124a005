use super::Finest;
use mrfgs::image::{Pair, Pixel, Plane};
use mrfgs::low_level::backend::Map;
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::{flag, has_disparity};

/// Parameters of the enlargement at edges.
#[derive(Clone, Copy)]
pub struct Edges {
    /// The penalty of a pixel of distance, in levels.
    pub away: i64,
    /// The excess dissimilarity, in levels, up to which a pixel still counts.
    pub near: i64,
    /// The span of disparities without an edge, in 1/256 px.
    pub flat: i64,
}

impl Edges {
    pub const DEFINED: Self = Self { away: 8, near: 64, flat: 256 };
}

/// The maps at full size; `pair` has that size as its full one.
pub fn enlarge(plan: &Plan, pair: &Pair, maps: &Finest) -> Vec<(Map, Plane<i32>)> {
    enlarge_by(&Edges::DEFINED, plan, pair, maps)
}

/// Like [`enlarge`], with other parameters.
pub fn enlarge_by(edges: &Edges, plan: &Plan, pair: &Pair, maps: &Finest) -> Vec<(Map, Plane<i32>)> {
    let full = pair.full().unwrap().left();
    let range = plan.of_pair().range;
    let (width, height) = maps.disparity.size();
    let known = |at: (usize, usize)| has_disparity(maps.validity[at] as u8);
    let within =
        |half: i32| (2 * i64::from(half)).clamp(256 * i64::from(range.min), 256 * i64::from(range.max));
    let d = |at: (usize, usize)| within(maps.disparity[at]);
    // Disparity, and the pixel that provides the flags.
    let at_full = |x: usize, y: usize| -> (i64, (usize, usize)) {
        let own = (x / 2, y / 2);
        if !known(own) || full.masked[(x, y)] {
            return (d(own), own);
        }
        let around: Vec<(usize, usize)> = (0..height)
            .flat_map(|v| (0..width).map(move |u| (u, v)))
            .filter(|&(u, v)| u.abs_diff(own.0) <= 1 && v.abs_diff(own.1) <= 1 && known((u, v)))
            .collect();
        let least = around.iter().map(|&at| d(at)).min().unwrap();
        let most = around.iter().map(|&at| d(at)).max().unwrap();
        if most - least <= edges.flat {
            let beside = |place: usize, own: usize, size: usize| {
                let to = own as i64 + if place % 2 == 1 { 1 } else { -1 };
                to.clamp(0, size as i64 - 1) as usize
            };
            let (u, v) = (beside(x, own.0, width), beside(y, own.1, height));
            let value = |at| if known(at) { d(at) } else { d(own) };
            let sum = 9 * d(own) + 3 * value((u, own.1)) + 3 * value((own.0, v)) + value((u, v));
            return ((sum + 8).div_euclid(16), own);
        }
        let level = |pixel: Pixel, c: usize| i64::from(pixel[c] / 256);
        let unlike = |at: (usize, usize)| {
            let (half, own) = (pair.left().pixels[at], full.pixels[(x, y)]);
            let colour: i64 = (0..3).map(|c| (level(half, c) - level(own, c)).abs()).sum();
            let far = |half: usize, place: usize| (2.0 * half as f64 + 0.5 - place as f64).abs();
            colour + edges.away * (far(at.0, x) + far(at.1, y)) as i64
        };
        let like = *around.iter().min_by_key(|&&at| (unlike(at), at.1, at.0)).unwrap();
        let near = around.iter().filter(|&&at| (d(at) - d(like)).abs() <= 256);
        let weight = |at| (edges.near + unlike(like) - unlike(at)).max(0);
        let weights: i64 = near.clone().map(|&at| weight(at)).sum();
        let sum: i64 = near.map(|&at| weight(at) * (d(at) - d(like))).sum();
        (d(like) + (sum as f64 / weights as f64).trunc() as i64, like)
    };
    let places = Plane::from_fn(2 * width, 2 * height, at_full);
    let masked = |x: usize, y: usize| full.masked[(x, y)];
    let flags = |map: &Plane<i32>, hidden: i32| {
        Plane::from_fn(
            2 * width,
            2 * height,
            |x, y| if masked(x, y) { hidden } else { map[places[(x, y)].1] },
        )
    };
    vec![
        (Map::FullRaw, Plane::from_fn(2 * width, 2 * height, |x, y| within(maps.raw[(x / 2, y / 2)]) as i32)),
        (Map::FullDisparity, places.map(|place| place.0 as i32)),
        (Map::FullValidity, flags(&maps.validity, flag::MASKED.into())),
        (Map::FullConfidence, flags(&maps.confidence, 0)),
    ]
}
