use super::census::census;
use mrfgs::image::{Image, Pair};
use mrfgs::options::Cost;
use mrfgs::plan::{COST_MAX, Plan};

/// Matching cost of level 0.
pub fn cost(plan: &Plan, pair: &Pair) -> Vec<u32> {
    let level = &plan.levels[0];
    let (left, right) = (pair.left(), pair.right());
    let (left_census, right_census) = (census(left), census(right));
    let mut out = Vec::new();
    for y in 0..level.height as i64 {
        for x in 0..level.width as i64 {
            for label in 0..level.labels as i64 {
                let d = i64::from(level.min) + label;
                if !usable(left, x, y) || !usable(right, x - d, y) {
                    out.push(u32::from(plan.outside_cost));
                    continue;
                }
                let cost = match plan.method.cost {
                    Cost::Sad => sad(left, right, x, y, d, i64::from(plan.method.sad_window)),
                    Cost::AdCensus => {
                        let at = |x: i64| (y * level.width as i64 + x) as usize;
                        let (l, r) = (&left_census[at(x)], &right_census[at(x - d)]);
                        let hamming = l.iter().zip(r).filter(|(l, r)| l != r).count();
                        exponential(difference(left, x, right, x - d, y) / 256) + exponential(hamming as i64)
                    }
                };
                out.push(u32::try_from(cost).unwrap());
            }
        }
    }
    out
}

/// round(127 (1 - exp(-v / 30))): of the colour difference of three channels, as AD / 10 is a third of it over 10,
/// and of the Hamming distance alike.
fn exponential(v: i64) -> i64 {
    (127.0 * (1.0 - (-(v as f64) / 30.0).exp())).round() as i64
}

/// Mean over the valid places of the window and the three channels, in 8-bit levels, ties up.
fn sad(left: &Image, right: &Image, x: i64, y: i64, d: i64, window: i64) -> i64 {
    let radius = window / 2;
    let (mut sum, mut places) = (0, 0);
    for j in -radius..=radius {
        for i in -radius..=radius {
            if usable(left, x + i, y + j) && usable(right, x - d + i, y + j) {
                sum += difference(left, x + i, right, x - d + i, y + j);
                places += 1;
            }
        }
    }
    let per_level = 768 * places;
    ((2 * sum + per_level) / (2 * per_level)).min(i64::from(COST_MAX))
}

fn usable(image: &Image, x: i64, y: i64) -> bool {
    let inside = x >= 0 && y >= 0 && x < image.width() as i64 && y < image.height() as i64;
    inside && !image.masked[(x as usize, y as usize)]
}

/// |dr| + |dg| + |db|.
fn difference(left: &Image, xl: i64, right: &Image, xr: i64, y: i64) -> i64 {
    let l = left.pixels[(xl as usize, y as usize)];
    let r = right.pixels[(xr as usize, y as usize)];
    (0..3).map(|c| (i64::from(l[c]) - i64::from(r[c])).abs()).sum()
}
