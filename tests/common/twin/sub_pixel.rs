use super::Finest;
use mrfgs::image::Plane;
use mrfgs::low_level::plan::Plan;

/// Parameters of the fit: the neighbours that count, and the limit.
#[derive(Clone, Copy)]
pub struct Fit {
    /// Columns and rows to either side that count.
    pub reach: (i64, i64),
    /// Largest label difference between a neighbour and the centre.
    pub near: i64,
    /// Largest offset from the label, in 1/256 px.
    pub most: f64,
}

impl Fit {
    pub const DEFINED: Self = Self { reach: (2, 1), near: 2, most: 256.0 };
}

/// The disparity of each pixel, in 1/256 px.
pub fn sub_pixel(plan: &Plan, cost: &[u32], maps: &mut Finest) {
    sub_pixel_by(&Fit::DEFINED, plan, cost, maps);
}

/// Like [`sub_pixel`], with other parameters.
pub fn sub_pixel_by(fit: &Fit, plan: &Plan, cost: &[u32], maps: &mut Finest) {
    let level = &plan.levels[0];
    let (width, height, labels) = (level.width as i64, level.height as i64, level.labels as i64);
    let offset = |x: usize, y: usize| {
        let label = i64::from(maps.label[(x, y)]);
        if label == 0 || label >= labels - 1 {
            return 0;
        }
        let sum_at = |wanted: i64| {
            let mut sum = 0;
            for v in y as i64 - fit.reach.1..=y as i64 + fit.reach.1 {
                for u in x as i64 - fit.reach.0..=x as i64 + fit.reach.0 {
                    if u < 0 || v < 0 || u >= width || v >= height {
                        continue;
                    }
                    if (i64::from(maps.label[(u as usize, v as usize)]) - label).abs() <= fit.near {
                        sum += i64::from(cost[((v * width + u) * labels + wanted) as usize]);
                    }
                }
            }
            sum
        };
        let (a, b, c) = (sum_at(label - 1), sum_at(label), sum_at(label + 1));
        let s = a.max(c) - b;
        if s <= 0 {
            return 0;
        }
        // Floats represent these fractions exactly enough, because a quotient by 2 s is never closer to a
        // whole number than 1 / (2 s), unless it is one.
        let exact = (256 * (a - c) + s) as f64 / (2 * s) as f64;
        exact.floor().clamp(-fit.most, fit.most) as i32
    };
    maps.raw = Plane::from_fn(level.width, level.height, |x, y| {
        let whole = 256 * (plan.range.min + maps.label[(x, y)].min(level.labels as i32 - 1));
        if plan.method.refinement.sub_pixel { whole + offset(x, y) } else { whole }
    });
    maps.disparity = maps.raw.clone();
}
