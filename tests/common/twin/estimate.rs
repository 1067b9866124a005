use super::change::labels;
use super::sub_pixel::sub_pixel;
use mrfgs::backend::{Estimate, NO_LABEL, Peak};
use mrfgs::image::Plane;
use mrfgs::plan::Plan;

/// The optimum of every pixel, its offset between labels, and the map of the right view.
pub fn estimate(plan: &Plan, cost: &[u32], belief: &[u32]) -> Estimate {
    let level = &plan.levels[0];
    let (width, height, count) = (level.width, level.height, level.labels as i64);
    let at = |x: usize, y: usize, d: i64| belief[(y * width + x) * level.labels + d as usize];
    let best = labels(belief, level.labels);
    let peaks = Plane::from_fn(width, height, |x, y| {
        let label = best[y * width + x];
        let smallest_of = |wanted: &dyn Fn(i64) -> bool| {
            let values = (0..count).filter(|&d| wanted(d - label)).map(|d| at(x, y, d));
            values.min().map_or(u16::MAX, |v| u16::try_from(v).unwrap())
        };
        Peak {
            label: label as u16,
            best: smallest_of(&|step| step == 0),
            rival: smallest_of(&|step| step.abs() > 1),
        }
    });
    let right = Plane::from_fn(width, height, |x, y| {
        let mut smallest = None;
        for d in 0..count {
            let left = x as i64 + i64::from(level.min) + d;
            if left >= 0 && left < width as i64 {
                let b = at(left as usize, y, d);
                if smallest.is_none_or(|(_, least)| b < least) {
                    smallest = Some((d as u16, b));
                }
            }
        }
        smallest.map_or(NO_LABEL, |(d, _)| d)
    });
    let offsets = sub_pixel(plan, cost, &peaks);
    Estimate { peaks, offsets, right }
}
