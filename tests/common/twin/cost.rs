use super::census::census;
use mrfgs::image::{Image, Pair};
use mrfgs::low_level::plan::{COST_MAX, Plan};
use mrfgs::options::MatchingCost;

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
                let census = || {
                    let at = |x: i64| (y * level.width as i64 + x) as usize;
                    let (l, r) = (&left_census[at(x)], &right_census[at(x - d)]);
                    let hamming = l.iter().zip(r).filter(|(l, r)| l != r).count();
                    4 * (hamming as i64).min(40)
                };
                let cost = match plan.method.cost.matching {
                    MatchingCost::Sad => {
                        let options = &plan.method.cost;
                        sad(left, right, x, y, d, i64::from(options.sad_window), i64::from(options.sad_steps))
                    }
                    MatchingCost::Census => census(),
                    MatchingCost::AdCensus => {
                        let colour = difference(left, x, right, x - d, y, |level| level / 256).min(64);
                        census() + (weight(plan, left, x, y) * colour + 32) / 64
                    }
                };
                out.push(u32::try_from(cost).unwrap());
            }
        }
    }
    out
}

/// Weight of colour, 0 to 48, from the variance of grey, in 8-bit levels, in the window of the census.
fn weight(plan: &Plan, image: &Image, x: i64, y: i64) -> i64 {
    let enough =
        (3969.0 * plan.method.cost.colour_contrast * plan.method.cost.colour_contrast).round() as i64;
    let grey = |x: i64, y: i64| i64::from(image.pixels[(x as usize, y as usize)][3]) / 256;
    let mut greys = Vec::new();
    for dy in -3..=3 {
        for dx in -4..=4 {
            let nx = (x + dx).clamp(0, image.width() as i64 - 1);
            let ny = (y + dy).clamp(0, image.height() as i64 - 1);
            let masked = image.masked[(nx as usize, ny as usize)];
            greys.push(if masked { grey(x, y) } else { grey(nx, ny) });
        }
    }
    let sum: i64 = greys.iter().sum();
    let squares: i64 = greys.iter().map(|g| g * g).sum();
    let variance = 63 * squares - sum * sum;
    if variance >= enough { 48 } else { 48 * variance / enough }
}

/// Mean over the valid pixels of the window and the three channels, in `steps` per 8-bit level, ties up.
fn sad(left: &Image, right: &Image, x: i64, y: i64, d: i64, window: i64, steps: i64) -> i64 {
    let radius = window / 2;
    let (mut sum, mut places) = (0, 0);
    for j in -radius..=radius {
        for i in -radius..=radius {
            if usable(left, x + i, y + j) && usable(right, x - d + i, y + j) {
                sum += difference(left, x + i, right, x - d + i, y + j, |level| level);
                places += 1;
            }
        }
    }
    let per_level = 768 * places;
    ((2 * steps * sum + per_level) / (2 * per_level)).min(i64::from(COST_MAX))
}

fn usable(image: &Image, x: i64, y: i64) -> bool {
    let inside = x >= 0 && y >= 0 && x < image.width() as i64 && y < image.height() as i64;
    inside && !image.masked[(x as usize, y as usize)]
}

/// |dr| + |dg| + |db|, with `level` applied to each channel.
fn difference(left: &Image, xl: i64, right: &Image, xr: i64, y: i64, level: fn(i64) -> i64) -> i64 {
    let l = left.pixels[(xl as usize, y as usize)];
    let r = right.pixels[(xr as usize, y as usize)];
    (0..3).map(|c| (level(l[c].into()) - level(r[c].into())).abs()).sum()
}
