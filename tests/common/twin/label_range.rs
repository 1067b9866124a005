use mrfgs::image::Plane;
use mrfgs::low_level::plan::Plan;

/// The costs of level `z`, with the largest cost at labels outside a pixel's label range.
pub fn label_range(plan: &Plan, z: usize, label_range: &Plane<[u16; 2]>, cost: &[u32]) -> Vec<u32> {
    let labels = plan.levels[z].labels;
    let highest = if z == 0 { 254 } else { 254 * 256 };
    let outside = |i: usize| {
        let [first, last] = label_range.data()[i / labels].map(usize::from);
        i % labels < first || i % labels > last
    };
    cost.iter().enumerate().map(|(i, &c)| if outside(i) { highest } else { c }).collect()
}
