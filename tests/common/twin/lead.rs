use super::prior::cost;
use super::{Finest, most};
use mrfgs::image::Plane;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::stage::LabelPrior;

/// The runner-up of every pixel without the guess of the pixel itself.
pub fn lead(plan: &Plan, belief: &[u32], prior: &Plane<LabelPrior>, maps: &mut Finest) {
    let (width, height) = plan.size();
    let labels = plan.levels[0].labels;
    for y in 0..height {
        for x in 0..width {
            let known = prior[(x, y)];
            if known.cap == 0 || known.cap > 5 {
                continue;
            }
            let b = &belief[(y * width + x) * labels..][..labels];
            let label = maps.label[(x, y)] as usize;
            let others = (0..labels).filter(|k| k.abs_diff(label) > 1 && b[*k] < most(plan));
            let without = others.map(|k| i64::from(b[k]) - cost(plan, 0, known, k));
            if let Some(least) = without.min() {
                let other = (least + cost(plan, 0, known, label)) as i32;
                maps.runner_up[(x, y)] = other.max(maps.best[(x, y)]);
            } else {
                maps.runner_up[(x, y)] = 65_535;
            }
        }
    }
}
